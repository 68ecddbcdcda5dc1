// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/shared_reading.hpp>

#include "port/group_port.hpp"
#include "port/network_interface.hpp"
#include "transport/datagram_io.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/ip/udp.hpp>

#include <cstddef>
#include <memory>
#include <string_view>
#include <vector>

namespace cles::transport {

core::group_source source_of(const boost::asio::ip::udp::endpoint& end);

/// The socket that receives a multicast group on one interface: that group and nothing else (no unicast, no other group
/// or interface), beside other programs of the host. All nodes on one executor share it, so that the system copies each
/// datagram once for them all.
class group_receiver : public std::enable_shared_from_this<group_receiver> {
  public:
    using udp = boost::asio::ip::udp;

    /// The receiver that nodes on this executor share, or a new one, which joins. \throws boost::system::system_error
    static std::shared_ptr<group_receiver> of(const boost::asio::any_io_executor& executor,
                                              const core::network_interface& by, const udp::endpoint& group);
    /// Joins the group. \throws boost::system::system_error
    group_receiver(const boost::asio::any_io_executor& executor, const core::network_interface& by,
                   const udp::endpoint& group);

    /// Starts to deliver to this listener too, up to a number of datagrams per turn; nothing is allocated for one
    /// except what parsing it keeps. The listener must live until it is removed. It need not receive what it sends
    /// itself from `source`; while it is the only one, the system drops that.
    void add(core::group_listener& listener, const core::group_source& source);
    /// Nothing more is delivered to it; may be called during delivery. With the last listener, the socket is closed.
    void remove(const core::group_listener& listener);

    [[nodiscard]] bool is_for(const boost::asio::any_io_executor& executor, const core::network_interface& by,
                              const udp::endpoint& group);

  private:
    struct place {
        core::group_listener* events; // null: removed during delivery
        core::group_source source;
    };
    /// A datagram that was fetched.
    struct received_datagram {
        core::group_source from;
        std::string_view text;
        bool good = false;
        protocol::request_line request{}; // if it is good
        detail::shared_reading reading{}; // of its body
    };

    void filter();
    void receive();
    void deliver();
    void continue_soon();
    [[nodiscard]] bool fetch();
    void deliver_to_next();

    udp::endpoint group_;
    int interface_;
    udp::socket socket_;
    receive_batch arrived_;
    bool more_ = false; // more may have arrived
    std::vector<place> listeners_;
    std::size_t active_listeners_ = 0; // number of listeners that are not null
    bool delivering_ = false;
    std::vector<received_datagram> received_;
    std::size_t next_ = 0; // the first listener that has not received everything
    std::size_t at_ = 0;   // the first datagram that this one has not received
};

} // namespace cles::transport
