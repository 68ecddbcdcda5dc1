// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>

namespace cles::test {

/// A group on loopback for one test: tests that run at the same time use other ports.
inline multicast_options fresh_group() {
    boost::asio::io_context io;
    const boost::asio::ip::udp::socket free{io, {boost::asio::ip::udp::v4(), 0}};
    multicast_options where;
    where.interface = "lo";
    where.port = free.local_endpoint().port();
    return where;
}

} // namespace cles::test
