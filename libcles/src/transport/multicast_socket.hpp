// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/ip/udp.hpp>
#include <boost/system/system_error.hpp>

#include <cerrno>

#include <netinet/in.h>
#include <sys/socket.h>

namespace cles::transport {

/// Sets an option that Asio lacks, or for which it takes an address instead of an interface's index.
/// \throws boost::system::system_error
template <class T>
void set_ip_option(boost::asio::ip::udp::socket& socket, int option, const T& value) {
    if (::setsockopt(socket.native_handle(), IPPROTO_IP, option, &value, sizeof value) != 0) {
        throw boost::system::system_error{errno, boost::system::system_category()};
    }
}

inline ip_mreqn membership(const boost::asio::ip::udp::endpoint& group, int interface) noexcept {
    ip_mreqn wanted{};
    wanted.imr_multiaddr.s_addr = htonl(group.address().to_v4().to_uint());
    wanted.imr_ifindex = interface;
    return wanted;
}

/// Makes the system drop what arrives from this address and port before it is queued (a classic BPF filter, see
/// socket(7)). Replaces an earlier filter. If the system refuses, everything still arrives.
void drop_from(boost::asio::ip::udp::socket& socket, const boost::asio::ip::udp::endpoint& source) noexcept;
/// Makes it drop everything that arrives.
void drop_all(boost::asio::ip::udp::socket& socket) noexcept;
/// Ends either.
void drop_nothing(boost::asio::ip::udp::socket& socket) noexcept;

} // namespace cles::transport
