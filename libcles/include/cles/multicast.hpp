// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles {

/// Where a service takes part in multicast (docs/protocol.md, "Multicast"): IPv4, by one interface or several. Group
/// and port are the same on all nodes that are to hear each other. The group is one of the local scope of RFC 2365, and
/// datagrams go out with a TTL of 1, so that no router passes them on.
struct multicast_options {
    /// Its name: "eth0", "lo"; several with commas between: "lo,eth0", up to `most_interfaces`; "auto": as
    /// `interfaces_of` says, when the service starts. Empty: no multicast.
    std::string interface {};
    std::string group = "239.255.25.37"; ///< an address from 224.0.0.0 to 239.255.255.255
    std::uint16_t port = 25370;          ///< not 0, since the others could not know it
    /// False: where the group cannot be joined there, that is a warning in the log, and the service does without. Of
    /// several interfaces those are used by which it can be joined.
    bool required = true;

    static constexpr std::size_t most_interfaces = 8;

    [[nodiscard]] bool is_on() const noexcept { return !interface.empty(); }
    bool operator==(const multicast_options&) const = default;
};

/// Reads "lo", "lo,eth0", "auto", each also with ",239.255.0.7" or ",239.255.0.7:4000" behind it, or "off", as programs
/// take it. What begins with a digit or has a colon in it is a group, unless it comes first.
/// \throws cles::error with `invalid_url` where it is none of these
multicast_options parse_multicast(std::string_view text);

/// Whether the names of the interfaces, group and port can be what they are meant for. \throws cles::error with
/// `invalid_url` where they cannot
void check(const multicast_options& where);

/// The names of the interfaces, in order, whether or not there are such on this host; none where multicast is off.
/// `auto` stands for loopback, and then, in the system's order, each that is up, has a link and an IPv4 address,
/// carries multicast, and is not point-to-point (a tunnel), all together up to `most_interfaces`.
std::vector<std::string> interfaces_of(const multicast_options& where);

} // namespace cles
