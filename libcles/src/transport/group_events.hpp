// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/request_line.hpp"

#include <boost/asio/ip/udp.hpp>

#include <string_view>

namespace cles::transport {

/// What came in a datagram, read once for all who hear it; valid for the call.
struct group_datagram {
    const boost::asio::ip::udp::endpoint& from;
    std::string_view text;
    const protocol::request_line* said; ///< null: nothing that a group is for
};

/// What comes from a multicast group, on the executor of the listener.
class group_events {
  public:
    group_events() = default;
    group_events(const group_events&) = delete;
    group_events& operator=(const group_events&) = delete;
    /// Its own ones too, where others listen at the same socket.
    virtual void on_datagram(const group_datagram& datagram) = 0;
    /// All that there was has been handed over.
    virtual void on_batch() = 0;
    /// What had to wait has been sent.
    virtual void on_room() = 0;

  protected:
    ~group_events() = default;
};

} // namespace cles::transport
