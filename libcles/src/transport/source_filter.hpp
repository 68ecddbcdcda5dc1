// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/ip/udp.hpp>

namespace cles::transport {

/// Has the system drop what comes from this address and port, before it waits for anybody (a classic BPF filter, see
/// socket(7)). Takes the place of a filter that was there. Where the system refuses, all still comes.
void drop_from(boost::asio::ip::udp::socket& socket, const boost::asio::ip::udp::endpoint& source) noexcept;
/// Has it drop all that comes.
void drop_all(boost::asio::ip::udp::socket& socket) noexcept;
/// Ends either.
void drop_nothing(boost::asio::ip::udp::socket& socket) noexcept;

} // namespace cles::transport
