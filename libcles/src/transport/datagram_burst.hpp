// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_port.hpp"

#include <boost/asio/ip/udp.hpp>

#include <cstddef>
#include <optional>
#include <string_view>

namespace cles::transport {

/// Sends whole lines, each with its LF as a datagram of its own, as many as go by one system call (sendmmsg(2)). Those
/// of one length that follow each other pass through the system as one, until the network or a socket that does not
/// take them so parts them (UDP_SEGMENT, udp(7)): finding the way is most of what a datagram costs.
///
/// Where the system or the interface cannot do that, each goes alone.
class datagram_burst {
  public:
    using udp = boost::asio::ip::udp;

    /// \pre the socket outlives it, and does not block
    explicit datagram_burst(udp::socket& socket) noexcept;

    /// To whom the socket is connected, or else to `to`. A line that cannot be sent is as good as lost on its way, and
    /// done with. \return what is done; nothing: there is no room \pre there is a line
    core::lines_done send(std::string_view lines, const udp::endpoint* to = nullptr) noexcept;

  private:
    // Nothing: the first run cannot go as one.
    std::optional<core::lines_done> send_runs(std::string_view lines, std::size_t longest,
                                              const udp::endpoint* to) noexcept;

    udp::socket& socket_;
    bool segments_;
};

} // namespace cles::transport
