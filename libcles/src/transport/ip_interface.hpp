// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/ip/address_v4.hpp>

#include <string>
#include <vector>

namespace cles::transport {

/// A network interface of this host, as far as IPv4 needs it.
struct ip_interface {
    std::string name{};
    int index = 0;
    boost::asio::ip::address_v4 address{}; ///< its first one; unspecified: it has none
    bool loopback = false;
    bool running = false;        ///< it is up, and has a link
    bool multicast = false;      ///< it says so of itself; loopback does not, and carries it all the same
    bool point_to_point = false; ///< a tunnel, for one
};

/// \throws boost::system::system_error where there is none of that name, or it is down or has no IPv4 address
ip_interface find_interface(const std::string& name);

/// All there are, by their numbers. \throws boost::system::system_error where the system does not say
std::vector<ip_interface> interfaces_of_host();

/// Those of them by which a node takes part in multicast that was told `auto` (cles/multicast.hpp): loopback first.
std::vector<ip_interface> automatic(std::vector<ip_interface> all);

} // namespace cles::transport
