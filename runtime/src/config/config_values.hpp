// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"

#include <chrono>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

/// What a text of the configuration stands for, wherever it was written: in the file, the environment, or a flag.

namespace cles::runtime {

/// A text that cannot be what it is meant for. Says so: "'9x' is not a number from 1 to 65535".
class bad_value : public std::invalid_argument {
  public:
    using std::invalid_argument::invalid_argument;
};

// All of these throw bad_value.

/// "true", "false"; "on", "off"; "yes", "no"
bool to_switch(std::string_view text);
std::uint64_t to_count(std::string_view text, std::uint64_t least, std::uint64_t most);
/// Bytes: "4096", "64KiB", "1MiB", "1GiB"
std::uint64_t to_size(std::string_view text, std::uint64_t least, std::uint64_t most);
/// "50us", "250ms", "1.5s", "2min", "1h", and "0"; a day at most
std::chrono::microseconds to_duration(std::string_view text);
/// A time, or "off": nothing. A mere 0 is refused, since it reads like off.
std::optional<std::chrono::microseconds> to_wake_bound(std::string_view text);
/// As `to_wake_bound` reads it.
std::string wake_bound_text(std::optional<std::chrono::microseconds> bound);

std::string to_node_name(std::string_view text);
/// Empty: the one without a name.
std::string to_pool_name(std::string_view text);
/// A URL at which a daemon may listen or ask: of a registered scheme, and not inside a process.
std::string to_url(std::string_view text);
/// "10.0.0.0/8", "fd00::/8"
std::string to_network(std::string_view text);
multicast_options to_multicast(std::string_view text);
/// The names of interfaces for multicast, with commas between, or `auto`.
std::string to_interfaces(std::string_view text);

log_level to_log_level(std::string_view text);
log_format to_log_format(std::string_view text);
/// "debug", "json", or both, "debug,json", over what is there.
log_config to_log(std::string_view text, log_config otherwise);

std::string_view to_string(log_level level) noexcept;
std::string_view to_string(log_format format) noexcept;
/// As `to_duration` reads it, in the largest unit that leaves no fraction.
std::string to_string(std::chrono::microseconds span);

} // namespace cles::runtime
