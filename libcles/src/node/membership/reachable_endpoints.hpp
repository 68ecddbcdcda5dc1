// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "port/group_port.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Where an announcement came from. Its host replaces an unspecified address.
struct observed_source {
    std::string host;   ///< IP address without brackets; empty if there is none
    bool local = false; ///< this host: its loopback addresses and Unix sockets are usable
    std::string name{}; ///< of the member at the other end of the link; empty: not proven

    /// The name of the link, if that is a link-local IPv6 address; otherwise empty.
    [[nodiscard]] std::string zone() const;

    static observed_source of(const group_source& from) { return {host_text(from), from.is_loopback()}; }
    /// The other end of a link.
    static observed_source of(const identity& peer);
    /// The node asked at that URL.
    static observed_source at(std::string_view url);
};

/// The host of a peer's address. If that is not a URL, its whole text, which is empty if the peer disconnected before
/// the system could report its address.
std::string host_of(const identity& peer);
/// Whose share of what the node has for others is used up by a link: a network of addresses, or a local user.
std::string holder_of(const identity& peer);

/// The announced endpoints that are usable from here, the preferred one first.
///
/// An unspecified address stands for where the announcement came from. Omitted are: `inproc`; Unix sockets and loopback
/// addresses, unless the announcement came over loopback and so from this host; and everything that is not an IP
/// address, since an announcement must not cause name lookups. A link-local IPv6 address is usable if the announcement
/// came from one: it is taken for an address on the same link.
///
/// Streams come before datagrams: `tcp`, then `unix` (whose permissions may exclude this process), then `udp`, then
/// unknown schemes. Among equals, the address that the announcement came from comes first, then the announced order.
std::vector<std::string> reachable_endpoints(const std::vector<std::string>& announced, const observed_source& from);

/// The announced endpoints as reported to other nodes: those that are of no use to them are omitted, and unspecified
/// addresses are replaced by the sender's host, unless that is this host. Link-local addresses have the zone of the
/// link on this host.
std::vector<std::string> endpoints_to_relay(const std::vector<std::string>& announced, const observed_source& from);

/// Those as they are told to a node that is connected by the link of that zone, or, if it is empty, in another way:
/// link-local addresses of that link without their zone, which means nothing to others, and none of other links.
std::vector<std::string> endpoints_on_link(const std::vector<std::string>& relayed, std::string_view zone);

} // namespace cles::core
