// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "transport/stream_link.hpp"

#include <boost/asio/basic_socket_acceptor.hpp>
#include <boost/asio/steady_timer.hpp>

#include <functional>
#include <memory>

namespace cles::transport {

/// Accepts connections of one protocol and makes links of them.
///
/// Where the process or the system has run out of descriptors or memory it waits a little and goes on.
template <class Protocol>
class stream_acceptor : public std::enable_shared_from_this<stream_acceptor<Protocol>> {
  public:
    using acceptor_type = typename Protocol::acceptor;
    using socket_type = typename Protocol::socket;
    using identify_function = std::function<identity(socket_type&)>;

    stream_acceptor(acceptor_type acceptor, const limits& bounds, identify_function identify)
        : acceptor_(std::move(acceptor)), pause_(acceptor_.get_executor()), bounds_(bounds),
          identify_(std::move(identify)) {}

    void start(std::function<void(link_ptr)> on_link) {
        on_link_ = std::move(on_link);
        accept();
    }

    void close() {
        boost::system::error_code ignored;
        acceptor_.close(ignored); // with it the last `accept` ends, and lets go of the callback
        pause_.cancel();
    }

    [[nodiscard]] const acceptor_type& socket() const noexcept { return acceptor_; }

    /// See `acceptor`.
    void accept_waiting() {
        accepts_waiting_ = true;
        boost::system::error_code code;
        acceptor_.non_blocking(true, code);
        while (!code && on_link_) {
            socket_type socket{acceptor_.get_executor()};
            acceptor_.accept(socket, code);
            if (!code) {
                hand_over(std::move(socket));
            }
        }
    }

  private:
    void hand_over(socket_type socket) {
        auto peer = identify_(socket);
        on_link_(std::make_shared<stream_link>(std::move(socket), std::move(peer), bounds_));
    }

    void accept() {
        acceptor_.async_accept([self = this->shared_from_this()](boost::system::error_code code, socket_type socket) {
            if (!code && self->on_link_ && (self->acceptor_.is_open() || self->accepts_waiting_)) {
                self->hand_over(std::move(socket));
            }
            if (!self->acceptor_.is_open() || !self->on_link_) {
                self->on_link_ = nullptr;
                return;
            }
            if (!code || is_the_peers(code)) {
                self->accept();
            } else {
                self->accept_later();
            }
        });
    }

    // Whether one connection failed before it was accepted (accept(2)): the next one may be well. All else, as when the
    // process or the system has no more descriptors, would fail again at once.
    static bool is_the_peers(const boost::system::error_code& code) {
        using namespace boost::system::errc;
        for (const auto one :
             {connection_aborted, connection_reset, protocol_error, no_protocol_option, host_unreachable,
              network_unreachable, network_down, operation_not_supported, timed_out, interrupted}) {
            if (code == one) {
                return true;
            }
        }
        return false;
    }

    void accept_later() {
        pause_.expires_after(std::chrono::milliseconds{100});
        pause_.async_wait([self = this->shared_from_this()](boost::system::error_code code) {
            if (!code && self->acceptor_.is_open()) {
                self->accept();
            }
        });
    }

    acceptor_type acceptor_;
    boost::asio::steady_timer pause_;
    limits bounds_;
    identify_function identify_;
    std::function<void(link_ptr)> on_link_;
    bool accepts_waiting_ = false; // also what completes behind `close`
};

} // namespace cles::transport
