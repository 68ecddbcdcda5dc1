// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/link.hpp>

#include "transport/stream_link.hpp"

#include <boost/asio/basic_socket_acceptor.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/steady_timer.hpp>

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

namespace cles::transport {

/// Makes one connection, to the first of several endpoints that accepts it, within `limits::connect` in all.
template <class Protocol>
class stream_dialler : public std::enable_shared_from_this<stream_dialler<Protocol>> {
  public:
    using socket_type = typename Protocol::socket;
    using endpoint_type = typename Protocol::endpoint;
    /// Prepares a connected socket and returns the identity of its peer.
    using identify_function = std::function<identity(socket_type&)>;

    stream_dialler(const boost::asio::any_io_executor& executor, const limits& bounds, identify_function identify,
                   dial_callback done)
        : socket_(executor), timeout_(executor), bounds_(bounds), identify_(std::move(identify)),
          done_(std::move(done)) {}

    /// \pre there is at least one
    void start(std::vector<endpoint_type> where) { start(std::move(where), bounds_.connect); }
    /// With this much time left.
    void start(std::vector<endpoint_type> where, std::chrono::milliseconds left) {
        where_ = std::move(where);
        timeout_.expires_after(left);
        timeout_.async_wait([self = this->shared_from_this()](boost::system::error_code code) {
            if (!code) {
                self->end(boost::asio::error::timed_out);
            }
        });
        connect();
    }

    void give_up() {
        done_ = nullptr;
        boost::system::error_code ignored;
        socket_.close(ignored);
        timeout_.cancel();
    }

  private:
    void connect() {
        socket_.async_connect(where_[tried_++], [self = this->shared_from_this()](boost::system::error_code code) {
            self->on_connected(code);
        });
    }

    void on_connected(boost::system::error_code code) {
        if (!done_) {
            return;
        }
        if (!code) {
            socket_.remote_endpoint(code); // Asio takes a Unix socket for connected if the listener's queue was full
            code = code == boost::asio::error::not_connected ? boost::asio::error::try_again : code;
        }
        if (code && tried_ < where_.size()) {
            boost::system::error_code ignored;
            socket_.close(ignored);
            connect();
        } else {
            end(code);
        }
    }

    void end(boost::system::error_code code) {
        auto done = std::exchange(done_, nullptr);
        timeout_.cancel();
        if (!done) {
            return;
        }
        if (code) {
            boost::system::error_code ignored;
            socket_.close(ignored);
            done(code, nullptr);
            return;
        }
        auto peer = identify_(socket_);
        done({}, std::make_shared<stream_link>(std::move(socket_), std::move(peer), bounds_));
    }

    socket_type socket_;
    boost::asio::steady_timer timeout_;
    limits bounds_;
    identify_function identify_;
    dial_callback done_;
    std::vector<endpoint_type> where_;
    std::size_t tried_ = 0;
};

/// Accepts connections of one protocol and makes links of them.
///
/// If the process or the system runs out of descriptors or memory, it waits a little and continues.
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
        acceptor_.close(ignored); // ends the pending accept, which releases the callback
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

    // Whether one connection failed before it was accepted (accept(2)): the next one may succeed. Other errors, such as
    // a lack of descriptors, would recur at once.
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
    bool accepts_waiting_ = false; // even what completes after `close`
};

} // namespace cles::transport
