// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/ip/udp.hpp>

#include <cstddef>
#include <string_view>

namespace cles::transport {

/// How much of some lines needs no more care.
struct lines_done {
    std::size_t lines = 0;
    std::size_t bytes = 0;
};

/// Sends whole lines, each with its LF as a datagram of its own, as many as go by one system call (sendmmsg(2)). One
/// that cannot be sent is as good as lost on its way, and done with. \return what is done; nothing: there is no room
/// \pre the socket is connected, and does not block; there is a line
lines_done send_burst(boost::asio::ip::udp::socket& socket, std::string_view lines) noexcept;

} // namespace cles::transport
