// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "transport/address_dialler.hpp"
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

/// Makes one connection, to the first of several endpoints that answers. With a codec, an endpoint has answered when
/// the link is open.
class stream_dialler final : public address_dialler {
  public:
    /// With a codec, the link is open when `done` receives it.
    stream_dialler(const boost::asio::any_io_executor& executor, const limits& bounds, identify_function identify,
                   dial_callback done, codec_maker make_codec = nullptr);

    /// `answered` is called with the number of the endpoint, just before `done`. \pre there is at least one
    void start(std::vector<stream_address> where, std::function<void(std::size_t)> answered = nullptr);

  private:
    class attempt;

    void begin(std::size_t which) override;
    void close_attempts() override;
    void on_connected(attempt& by, boost::system::error_code code);
    void on_opened(attempt& by, boost::system::error_code code);
    void on_failed(attempt& by, boost::system::error_code code);
    void complete(const attempt& by, link_ptr made);

    limits bounds_;
    identify_function identify_;
    boost::system::error_code refusal_; // by the codec, at an address that has answered
    codec_maker make_codec_;
    std::vector<stream_address> where_;
    std::vector<std::shared_ptr<attempt>> attempts_; // those that may still succeed
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
