// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace cles::core {

/// A network interface of this host, as far as IPv4 multicast needs it.
struct network_interface {
    std::string name{};
    int index = 0;
    std::uint32_t address = 0; ///< the first one; 127.0.0.1 is 0x7f000001; 0: none
    bool loopback = false;
    bool running = false;        ///< up, and with a link
    bool multicast = false;      ///< as the system reports it: false for loopback, which works nevertheless
    bool point_to_point = false; ///< such as a tunnel
};

/// The interfaces that a node with `auto` uses for multicast (cles/multicast.hpp): loopback first.
std::vector<network_interface> automatic(std::vector<network_interface> all);

} // namespace cles::core
