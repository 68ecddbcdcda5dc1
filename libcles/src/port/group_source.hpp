// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/container_hash/hash.hpp>

#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

/// The sender of a datagram to the group: the IPv4 address and port of a socket that belongs to one node for as long as
/// it runs.
struct group_source {
    std::uint32_t address = 0; ///< 127.0.0.1 is 0x7f000001
    std::uint16_t port = 0;

    // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 takes the resulting zero for a pointer
    auto operator<=>(const group_source&) const = default;
    [[nodiscard]] bool is_loopback() const noexcept { return address >> 24U == 127; }
};

inline std::size_t hash_value(const group_source& s) noexcept {
    std::size_t seed = s.port;
    boost::hash_combine(seed, s.address);
    return seed;
}

/// "10.0.0.2"
inline std::string host_text(const group_source& s) {
    std::string text;
    for (const unsigned shift : {24U, 16U, 8U, 0U}) {
        text.append(text.empty() ? "" : ".").append(std::to_string(s.address >> shift & 0xFFU));
    }
    return text;
}

/// "10.0.0.2:4000"
inline std::string to_text(const group_source& s) { return host_text(s) + ":" + std::to_string(s.port); }
/// Parses that; nothing if it is anything else.
std::optional<group_source> parse_group_source(std::string_view text) noexcept;

} // namespace cles::core
