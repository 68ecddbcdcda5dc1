// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/shared_reading.hpp>

#include "port/group_port.hpp"
#include "port/network_interface.hpp"
#include "transport/datagram_batch.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/ip/udp.hpp>

#include <cstddef>
#include <memory>
#include <string_view>
#include <vector>

namespace cles::transport {

core::group_source source_of(const boost::asio::ip::udp::endpoint& end);

/// The socket at which a multicast group is heard by one interface: that group and nothing else (no unicast, no other
/// group or interface), beside the other programs of the host that hear it. All nodes on one executor share it, so that
/// the system copies each datagram once for them all.
class group_receiver : public std::enable_shared_from_this<group_receiver> {
  public:
    using udp = boost::asio::ip::udp;

    /// The one that nodes on this executor have, or a new one, which joins. \throws boost::system::system_error
    static std::shared_ptr<group_receiver> of(const boost::asio::any_io_executor& executor,
                                              const core::network_interface& by, const udp::endpoint& group);
    /// Joins anew. \throws boost::system::system_error
    group_receiver(const boost::asio::any_io_executor& executor, const core::network_interface& by,
                   const udp::endpoint& group);

    /// Begins to hand over what comes to this one too, up to a number of datagrams a turn; nothing is allocated for
    /// one but what a reading of it keeps. The listener stays until it is removed. What it sends itself, from `source`,
    /// it need not hear; where it is alone, the system does not even bring it here.
    void add(core::group_listener& listener, const core::group_source& source);
    /// It receives nothing more, from inside a call as well. With the last the socket is closed.
    void remove(const core::group_listener& listener);

    [[nodiscard]] bool is_for(const boost::asio::any_io_executor& executor, const core::network_interface& by,
                              const udp::endpoint& group);

  private:
    struct place {
        core::group_listener* events; // null: removed while others were told
        core::group_source source;
    };
    /// A datagram of the fetch.
    struct heard {
        core::group_source from;
        std::string_view text;
        bool good = false;
        protocol::request_line said{};    // where it is good
        detail::shared_reading reading{}; // of its body
    };

    void filter();
    void receive();
    void hand_over();
    void go_on_soon();
    [[nodiscard]] bool fetch();
    void tell_next();

    udp::endpoint group_;
    int interface_;
    udp::socket socket_;
    datagram_batch arrived_;
    bool more_ = false; // there may be
    std::vector<place> listeners_;
    std::size_t hearing_ = 0; // those that are not null
    bool telling_ = false;
    std::vector<heard> heard_;
    std::size_t next_ = 0; // the first listener that has not heard all of it
    std::size_t at_ = 0;   // the first that this one has not heard
};

} // namespace cles::transport
