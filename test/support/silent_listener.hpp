// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>

namespace cles::test {

/// An address that does not answer those who connect to it, as one behind a firewall: its queue of connections is full,
/// so the system drops further ones.
class silent_listener {
  public:
    explicit silent_listener(boost::asio::io_context& io,
                             boost::asio::ip::address_v4 at = boost::asio::ip::address_v4::loopback(),
                             unsigned short port = 0)
        : listener_(io), first_(io) {
        const boost::asio::ip::tcp::endpoint where{at, port};
        listener_.open(where.protocol());
        listener_.bind(where);
        listener_.listen(0);
        first_.connect(listener_.local_endpoint());
    }
    [[nodiscard]] boost::asio::ip::tcp::endpoint where() const { return listener_.local_endpoint(); }

  private:
    boost::asio::ip::tcp::acceptor listener_;
    boost::asio::ip::tcp::socket first_;
};

} // namespace cles::test
