// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace cles {

/// Where a service takes part in multicast (docs/protocol.md, "Multicast"): IPv4, by one interface. Group and port are
/// the same on all nodes that are to hear each other. The group is one of the local scope of RFC 2365, and datagrams
/// go out with a TTL of 1, so that no router passes them on.
struct multicast_options {
    std::string interface {};            ///< its name: "eth0", "lo"; empty: no multicast
    std::string group = "239.255.25.37"; ///< an address from 224.0.0.0 to 239.255.255.255
    std::uint16_t port = 25370;          ///< not 0, since the others could not know it
    /// False: where the group cannot be joined there, that is a warning in the log, and the service does without.
    bool required = true;

    [[nodiscard]] bool is_on() const noexcept { return !interface.empty(); }
    bool operator==(const multicast_options&) const = default;
};

/// Reads "lo", "eth0,239.255.0.7", "eth0,239.255.0.7:4000" or "off", as programs take it.
/// \throws cles::error with `invalid_url` where it is none of these
multicast_options parse_multicast(std::string_view text);

/// Whether group and port can be what they are meant for. \throws cles::error with `invalid_url` where they cannot
void check(const multicast_options& where);

} // namespace cles
