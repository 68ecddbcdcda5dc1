// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "transport/private_socket.hpp"
#include "transport/stream_link.hpp"

#include <boost/asio/generic/stream_protocol.hpp>
#include <boost/asio/steady_timer.hpp>

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

/// How streams of any family are dialled and accepted.

namespace cles::transport {

using stream_address = boost::asio::generic::stream_protocol::endpoint;

/// Prepares a connected socket and returns the identity of its peer.
using identify_function = std::function<identity(stream_socket&)>;

/// Makes one connection, to the first of several endpoints that accepts it, within `limits::connect` in all since this
/// was created.
class stream_dialler : public std::enable_shared_from_this<stream_dialler> {
  public:
    /// With a codec, the link is open when `done` receives it.
    stream_dialler(const boost::asio::any_io_executor& executor, const limits& bounds, identify_function identify,
                   dial_callback done, codec_maker make_codec = nullptr);

    /// \pre there is at least one
    void start(std::vector<stream_address> where);
    /// Ends without a connection.
    void fail(boost::system::error_code why);
    /// As above, without the callback.
    void give_up();

  private:
    void on_timeout(boost::system::error_code code);
    void connect();
    void on_connected(boost::system::error_code code);
    void make_link();
    void complete(boost::system::error_code code);

    stream_socket socket_;
    boost::asio::steady_timer timeout_;
    limits bounds_;
    identify_function identify_;
    dial_callback done_;
    codec_maker make_codec_;
    std::shared_ptr<stream_link> made_; // while it is being opened
    std::vector<stream_address> where_;
    std::size_t tried_ = 0;
};

/// Accepts connections and makes links of them.
///
/// If the process or the system runs out of descriptors or memory, it waits a little and continues.
class stream_acceptor : public acceptor, public std::enable_shared_from_this<stream_acceptor> {
  public:
    /// With a codec, links are opened after they have been accepted.
    stream_acceptor(listening_socket socket, url local, const limits& bounds, identify_function identify,
                    codec_maker make_codec = nullptr);

    [[nodiscard]] url local() const override { return local_; }
    void start(std::function<void(link_ptr)> on_link) override;
    void accept_waiting() override;
    void close() override;

  private:
    void wait();
    void on_readable(boost::system::error_code code);
    /// Whether there may be more.
    [[nodiscard]] bool accept_one(boost::system::error_code& code);
    void accept_later();
    void after_pause(boost::system::error_code code);
    void hand_over(stream_socket socket);

    listening_socket acceptor_;
    boost::asio::generic::stream_protocol protocol_;
    url local_;
    boost::asio::steady_timer pause_;
    limits bounds_;
    identify_function identify_;
    codec_maker make_codec_;
    std::function<void(link_ptr)> on_link_;
};

} // namespace cles::transport
