// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"

#include <chrono>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

/// Conversions between the values of the configuration and their text in the file, the environment and the flags.

namespace cles::runtime {

/// Text that cannot be converted. The message says why: "'9x' is not a number from 1 to 65535".
class invalid_value : public std::invalid_argument {
  public:
    using std::invalid_argument::invalid_argument;
};

// All of these throw invalid_value.

/// "true", "false"; "on", "off"; "yes", "no"
bool to_bool(std::string_view text);
std::uint64_t to_count(std::string_view text, std::uint64_t min, std::uint64_t max);
/// Bytes: "4096", "64KiB", "1MiB", "1GiB"
std::uint64_t to_size(std::string_view text, std::uint64_t min, std::uint64_t max);
/// "50us", "250ms", "1.5s", "2min", "1h", and "0"; a day at max
std::chrono::microseconds to_duration(std::string_view text);
/// A duration, or "off": none. A plain 0 is refused, because it could be taken for "off".
std::optional<std::chrono::microseconds> to_wake_within(std::string_view text);
/// The inverse of `to_wake_within`.
std::string wake_within_text(std::optional<std::chrono::microseconds> bound);

std::string to_node_name(std::string_view text);
/// Empty: the unnamed pool.
std::string to_pool_name(std::string_view text);
/// The name of a pool that others reach: one word.
std::string to_federated_pool_name(std::string_view text);
/// "nats://host:4222", "tls://host:4222"
std::string to_nats_url(std::string_view text);
/// A URL for listening or connecting: of a registered scheme, and not only within a process.
std::string to_url(std::string_view text);
/// "10.0.0.0/8", "fd00::/8"
std::string to_network(std::string_view text);
multicast_options to_multicast(std::string_view text);
/// The names of network interfaces, separated by commas, or `auto`.
std::string to_interfaces(std::string_view text);

/// "process": true, "none": false
bool to_isolated(std::string_view text);
std::string to_absolute_path(std::string_view text);

/// The SHA-256 of a file, as `sha256sum` prints it: 64 hexadecimal digits, returned in small letters.
std::string to_sha256(std::string_view text);

log_level to_log_level(std::string_view text);
log_format to_log_format(std::string_view text);
/// "debug", "json", or both, as "debug,json". \param current supplies what the text does not set
log_config to_log_config(std::string_view text, log_config current);

std::string_view to_string(log_level level) noexcept;
std::string_view to_string(log_format format) noexcept;
/// The inverse of `to_duration`, in the largest unit without a fraction.
std::string to_string(std::chrono::microseconds span);

} // namespace cles::runtime
