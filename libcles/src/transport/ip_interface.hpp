// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/ip/address_v4.hpp>

#include <string>

namespace cles::transport {

/// A network interface of this host, as far as IPv4 needs it.
struct ip_interface {
    int index = 0;
    boost::asio::ip::address_v4 address; ///< its first one
    bool loopback = false;
};

/// \throws boost::system::system_error where there is none of that name, or it is down or has no IPv4 address
ip_interface find_interface(const std::string& name);

} // namespace cles::transport
