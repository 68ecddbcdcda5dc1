// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles {

/// Multicast of a service (docs/protocol.md, "Multicast"): IPv4, on one or more interfaces. Nodes reach each other if
/// they use the same group and port. The group is in the local scope of RFC 2365, and datagrams are sent with a TTL of
/// 1, so routers do not forward them.
struct multicast_options {
    /// Interface names: "eth0", "lo"; several separated by commas: "lo,eth0", up to `most_interfaces`; "auto": those
    /// that `interfaces_of` returns. The service follows their changes. Empty: no multicast.
    std::string interface {};
    std::string group = "239.255.25.37"; ///< an address from 224.0.0.0 to 239.255.255.255
    std::uint16_t port = 25370;          ///< not 0, because all nodes must use the same port
    /// If false, failing to join the group is a warning in the log, and the service works without multicast. If only
    /// some of several interfaces can join, those are used, and the others when they can. If true, the interfaces must
    /// be there only when the service starts.
    bool required = true;

    static constexpr std::size_t most_interfaces = 8;

    [[nodiscard]] bool is_on() const noexcept { return !interface.empty(); }
    bool operator==(const multicast_options&) const = default;
};

/// Parses "lo", "lo,eth0", "auto", each optionally followed by ",239.255.0.7" or ",239.255.0.7:4000", or "off", as
/// programs accept it on the command line. A part that begins with a digit or contains a colon is the group, unless it
/// is the first.
/// \throws cles::error with `invalid_url` if it is none of these
multicast_options parse_multicast(std::string_view text);

/// Checks the interface names, group and port. \throws cles::error with `invalid_url` if one is invalid
void check(const multicast_options& where);

/// The names of the interfaces, in order, whether or not they exist on this host; empty if multicast is off. `auto`
/// stands for loopback, followed by each interface, in the system's order, that is up, has a link and an IPv4 address,
/// supports multicast, and is not point-to-point (a tunnel); together up to `most_interfaces`.
std::vector<std::string> interfaces_of(const multicast_options& where);

} // namespace cles
