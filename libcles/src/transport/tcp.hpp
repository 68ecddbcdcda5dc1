// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "transport/stream_endpoint.hpp"

#include <boost/asio/any_io_executor.hpp>

#include <functional>
#include <memory>

namespace cles::transport {

/// Listens by TCP, for links of the URL's scheme. A host name is looked up by a call that may block.
/// \throws boost::system::system_error
std::unique_ptr<acceptor> listen_tcp(const boost::asio::any_io_executor& executor, const url& where,
                                     const limits& bounds, codec_maker make_codec = nullptr);

/// Dials by TCP; see `link_transport::dial`.
std::function<void()> dial_tcp(const boost::asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done, codec_maker make_codec = nullptr);

} // namespace cles::transport
