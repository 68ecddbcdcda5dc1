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
    std::uint32_t address = 0; ///< its first one, 127.0.0.1 as 0x7f000001; 0: it has none
    bool loopback = false;
    bool running = false;        ///< it is up, and has a link
    bool multicast = false;      ///< it says so of itself; loopback does not, and carries it all the same
    bool point_to_point = false; ///< a tunnel, for one
};

/// Those of them by which a node takes part in multicast that was told `auto` (cles/multicast.hpp): loopback first.
std::vector<network_interface> automatic(std::vector<network_interface> all);

} // namespace cles::core
