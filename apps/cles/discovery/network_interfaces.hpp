// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <vector>

namespace tool {

/// A network interface of this host.
struct net_interface {
    std::string name;
    std::string address{}; ///< its first IPv4 address; empty where it has none
    bool up = false;
    bool loopback = false;
    bool multicast = false; ///< it says so of itself; loopback does not, and carries multicast all the same
};

/// In the system's order. Empty where the system does not tell.
std::vector<net_interface> interfaces_of_host();

} // namespace tool
