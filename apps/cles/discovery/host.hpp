// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace tool {

// What this host says about its network interfaces and sockets.

struct network_interface {
    std::string name;
    std::string address{}; ///< its first IPv4 address, or empty
    bool up = false;
    bool loopback = false;
    bool multicast = false; ///< its multicast flag; loopback has none, but carries multicast all the same
};

/// In the system's order; empty if it cannot be determined.
std::vector<network_interface> network_interfaces();

/// Null if there is none of that name.
const network_interface* find_interface(const std::vector<network_interface>& all, std::string_view name);

/// Addresses of IPv4 and IPv6, of which each text has the bytes.
using host_addresses = std::vector<std::string>;

/// Those of the interfaces of this host, which may change; empty if they cannot be determined.
host_addresses own_addresses();
/// The address itself, or those that a name stands for; empty if it is not known. Looks names up, each once.
host_addresses addresses_of(const std::string& host);
/// Whether one of them is of this host, which has these own ones.
bool leads_here(const host_addresses& found, const host_addresses& own);
/// Whether an address, or one of those that a name stands for, is of this host now.
bool is_own_host(const std::string& host);

/// The program that listens at that port, as "nginx (process 812)"; empty if it cannot be determined, as for programs
/// of other users. \param protocol "tcp" or "udp"
std::string process_listening_at(std::string_view protocol, std::uint16_t port);

/// Whether it is certain that no node can answer in this group: it is used on loopback only, and no program of this
/// host listens to it. Call it before this program listens there itself.
bool has_no_listener(const cles::multicast_options& group);

} // namespace tool
