// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/log.hpp>
#include <cles/multicast.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace cles::runtime {

enum class log_format : std::uint8_t { text, json };

struct log_config {
    log_level level = log_level::info;
    log_format format = log_format::text;

    bool operator==(const log_config&) const = default;
};

struct plugin_config {
    std::string path;          ///< as it stands in the configuration
    std::string config = "{}"; ///< JSON, handed to the plugin as it is
    bool required = true;      ///< the daemon does not start without it
    std::string unusable{};    ///< what a trial found (`plugin_setup`); empty: nothing, or there was none

    bool operator==(const plugin_config&) const = default;
};

/// How a daemon is set up: what all its sources say together (docs/runtime.md).
struct config {
    std::string node;
    std::string pool;         ///< empty: the one without a name
    bool allow_clash = false; ///< goes on where another live node had its name first
    std::vector<std::string> listen;
    bool insecure = false;
    std::vector<std::string> networks;
    multicast_options multicast;
    std::vector<std::string> seeds;
    std::map<std::string, std::string> peers;

    std::uint32_t workers = 1;
    std::uint32_t queue = 1024;
    std::chrono::microseconds stuck_after{2'000'000}; ///< past its deadline, before a job's worker is replaced
    std::uint32_t replacements = 4;                   ///< workers at most that take the place of stuck ones
    std::chrono::microseconds drain{5'000'000};       ///< what running jobs have to end at a stop

    std::vector<plugin_config> plugins;
    std::vector<std::string> plugin_path; ///< folders where plugins are looked for that are named without one

    log_config log;
    cles::limits limits;
    std::chrono::microseconds busy_poll{0};
    std::uint32_t real_time = 0;
    std::optional<std::chrono::microseconds> wake_within; ///< nothing: as the host has it

    std::string file; ///< the configuration file; empty: none was there
    /// Where each value that is no default comes from, by its key's full path: "multicast.port" to "clesd.yaml:4".
    std::map<std::string, std::string> origins;

    /// How a complaint about a value begins: "clesd.yaml:7: plugins[0].path", with the place of what holds it where it
    /// has none itself, or the key alone where all is the default.
    [[nodiscard]] std::string place_of(const std::string& key) const;
};

/// What is true where nothing else is said. \param host what the machine is called \param cores that it has
config default_config(const std::string& host, std::uint32_t cores);

/// What no value shows by itself, only several together. \throws config_error
void check(const config& whole);

/// A configuration that cannot be used. Says where and why: "clesd.yaml:7: multicast.port: 70000 is not a number from
/// 1 to 65535".
class config_error : public std::runtime_error {
  public:
    explicit config_error(const std::string& words) : std::runtime_error(words) {}
    config_error(const std::string& place, const std::string& why) : std::runtime_error(place + ": " + why) {}
};

} // namespace cles::runtime
