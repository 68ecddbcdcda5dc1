// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "transport/stream_codec.hpp"

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

namespace cles::transport {

/// The maximum number of lines per turn of one link, so that a flooded one leaves others their turn.
inline constexpr int lines_per_turn = 1024;

/// The names of nodes as which users connect, by user id.
using user_names = std::map<std::uint32_t, std::string>;

/// `tcp://host:port`. Nagle's algorithm is off, keep-alive on. A host name at which to listen is looked up by a call
/// that may block.
std::unique_ptr<link_transport> make_tcp();

/// Listens by TCP, for links of the URL's scheme. A host name is looked up by a call that may block.
/// \throws boost::system::system_error
std::unique_ptr<acceptor> listen_tcp(const boost::asio::any_io_executor& executor, const url& where,
                                     const limits& bounds, codec_maker make_codec = nullptr);

/// Dials by TCP; see `link_transport::dial`.
std::function<void()> dial_tcp(const boost::asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done, codec_maker make_codec = nullptr);

/// `unix:///path` (a socket file; one on which nothing listens any more is replaced) and `unix://@name` (abstract). The
/// kernel reports the peer's user id; a client whose user is in `users` has that name. A file is for its owner only,
/// unless `users` has others, besides root.
///
/// With `users`, no link is made to a listener of another user, unless it is root or has, in `users`, the name of the
/// node that is dialled.
std::unique_ptr<link_transport> make_unix(user_names users = {});

/// `udp://host:port`: requests, replies and updates as one datagram each.
std::unique_ptr<link_transport> make_udp();

/// `inproc://name`: services of one process, each on an executor of its own or all on one.
std::unique_ptr<link_transport> make_inproc();

/// A handle of an acceptor that its links or pending operations share: destroying the handle closes the acceptor.
std::unique_ptr<acceptor> handle_of(std::shared_ptr<acceptor> shared);

/// Whether a service of this process listens at that name.
bool is_open(const std::string& name);

} // namespace cles::transport
