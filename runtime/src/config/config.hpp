// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/log.hpp>
#include <cles/multicast.hpp>

#include "isolation/isolation_limits.hpp"

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
    std::string path;          ///< as written in the configuration
    std::string config = "{}"; ///< JSON, passed to the plugin unchanged
    bool required = true;      ///< the daemon does not start without it
    std::string sha256{};      ///< of its file, in small hexadecimal digits; empty: any
    bool isolated = false;     ///< it runs in a process of its own
    isolation_limits limits{}; ///< of that process
    std::string
        trial_error{}; ///< why the plugin cannot be used (`try_plugins`); empty if it can, or has not been tried

    bool operator==(const plugin_config&) const = default;
};

/// The security of the node; see <cles/security.hpp>.
struct security_config {
    std::string keys;                               ///< the node's directory; empty: no security
    std::map<std::string, std::string> local_users; ///< members, by the names or ids of users

    [[nodiscard]] bool is_on() const noexcept { return !keys.empty(); }
    bool operator==(const security_config&) const = default;
};

/// How the node joins its pool to others; see <cles/federation.hpp>.
struct federation_config {
    std::vector<std::string> servers; ///< URLs of NATS; none: it does not
    std::string pool;
    std::string credentials; ///< these are files; empty: none
    std::string token;
    std::string tls_authority;
    std::string tls_certificate;
    std::string tls_key;

    [[nodiscard]] bool is_on() const noexcept { return !servers.empty(); }
    bool operator==(const federation_config&) const = default;
};

/// The configuration of a daemon, combined from all its sources (docs/runtime.md).
struct config {
    std::string node;
    std::string pool;         ///< empty: the unnamed pool
    bool allow_clash = false; ///< continue if another live node had the name first
    std::vector<std::string> listen;
    bool insecure = false;
    security_config security;
    std::vector<std::string> networks;
    multicast_options multicast;
    std::vector<std::string> seeds;
    std::vector<std::string> links; ///< the only nodes that this one may have links to; empty: all
    std::map<std::string, std::string> peers;
    federation_config federation;

    std::uint32_t workers = 1;
    std::uint32_t queue = 1024;
    std::chrono::microseconds stuck_after{2'000'000}; ///< after its deadline, before a job's worker is replaced
    std::uint32_t replacements = 4;                   ///< at most so many stuck workers are replaced
    bool sharing = true;                              ///< of jobs with other nodes (docs/sharing.md)
    std::chrono::microseconds drain{5'000'000};       ///< how long running jobs may take to end at a stop

    std::vector<plugin_config> plugins;
    /// Folders to search for plugins named without one; with security, plugins may be in these only, and those of CLES.
    std::vector<std::string> plugin_path;

    log_config log;
    cles::limits limits;
    std::chrono::microseconds busy_poll{0};
    std::uint32_t real_time = 0;
    std::optional<std::chrono::microseconds> wake_within; ///< none: not limited

    std::string file; ///< the configuration file; empty if there was none
    /// Where each value that is not a default comes from, by full key: "multicast.port" to "clesd.yaml:4".
    std::map<std::string, std::string> origins;

    /// The location and key with which a message about a value begins: "clesd.yaml:7: plugins[0].path". A value without
    /// a location of its own has that of the value that contains it; a default has none.
    [[nodiscard]] std::string location_of(const std::string& key) const;
    /// How many jobs of an isolated plugin may run at once: one for each worker and each replacement.
    [[nodiscard]] std::size_t lanes() const noexcept { return std::size_t{workers} + replacements; }
};

/// \param host the host's name \param cores the host's number of processor cores
config default_config(const std::string& host, std::uint32_t cores);

/// With security, a node is reachable from other hosts by default: it listens by TLS on all interfaces, and takes part
/// in multicast on all.
void apply_security_defaults(config& setup);

/// Checks what depends on several values. \throws config_error
void check(const config& setup);

/// A configuration that cannot be used. The message says where and why: "clesd.yaml:7: multicast.port: '70000' is not a
/// number from 1 to 65535".
class config_error : public std::runtime_error {
  public:
    explicit config_error(const std::string& message) : std::runtime_error(message) {}
    config_error(const std::string& location, const std::string& why) : std::runtime_error(location + ": " + why) {}
};

} // namespace cles::runtime
