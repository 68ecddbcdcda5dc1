// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/teller.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Where a node can be asked, of the endpoints that it announced, the best one first.
///
/// An address that is unspecified stands for where the announcement came from. Left out is what is of no use or no good
/// here: `inproc`; Unix sockets and loopback addresses, unless the announcement came by loopback and so from this host;
/// and what is no IP address, since a node that says where it is must not have names looked up.
///
/// Streams come before datagrams: `tcp`, then `unix` (whose permissions may keep others out), then `udp`, then schemes
/// that are not known here. Among equals an address that the announcement came from goes first, then the node's order.
std::vector<std::string> reachable_endpoints(const std::vector<std::string>& announced, const teller& from);

/// The same, as this node tells of them: what is of no use to a node that gets it from here is left out, and addresses
/// that are unspecified get the teller's host, unless that is this one.
std::vector<std::string> endpoints_to_pass_on(const std::vector<std::string>& announced, const teller& from);

} // namespace cles::core
