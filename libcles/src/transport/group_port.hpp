// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "transport/datagram_burst.hpp"
#include "transport/group_events.hpp"
#include "transport/group_receiver.hpp"
#include "transport/ip_interface.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/ip/udp.hpp>

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

namespace cles::transport {

/// A node's place in a multicast group, by one interface: where it receives the group, and a socket of its own to send
/// from, which tells the others who it is for as long as the node runs.
class group_port : public std::enable_shared_from_this<group_port> {
  public:
    using udp = boost::asio::ip::udp;

    /// Joins. \throws boost::system::system_error
    group_port(const boost::asio::any_io_executor& executor, const ip_interface& by, const multicast_options& where);

    /// Begins to hand over what comes. The owner stays until `close`.
    void start(group_events& owner);
    /// Sends whole lines, each with its LF as one datagram; what finds no room in the socket waits for it. A datagram
    /// that cannot be sent for another reason is as good as lost on its way.
    /// \return what it took; less than all where as much waits as may
    lines_done send(std::string_view lines);
    /// Bytes that wait for room.
    [[nodiscard]] std::size_t unsent() const noexcept { return waiting_.size() - waiting_at_; }
    void close();

    /// Where what this node sends comes from.
    [[nodiscard]] const udp::endpoint& source() const noexcept { return source_; }
    [[nodiscard]] const udp::endpoint& group() const noexcept { return group_; }

    static constexpr std::size_t most_waiting = 1U << 16U;

  private:
    void send_rest();
    void wait_for_room();

    udp::endpoint group_;
    udp::endpoint source_;
    std::shared_ptr<group_receiver> receiver_;
    udp::socket own_;
    datagram_burst burst_;
    group_events* owner_ = nullptr; // null: closed
    std::string waiting_;
    std::size_t waiting_at_ = 0;
    bool waits_for_room_ = false;
};

} // namespace cles::transport
