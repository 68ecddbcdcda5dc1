// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/link.hpp>

#include "transport/stream_link.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/steady_timer.hpp>

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

namespace cles::transport {

/// Makes one connection, to the first of some endpoints that takes it, within the time that the limits give in all.
template <class Protocol>
class stream_dialler : public std::enable_shared_from_this<stream_dialler<Protocol>> {
  public:
    using socket_type = typename Protocol::socket;
    using endpoint_type = typename Protocol::endpoint;
    /// Prepares a connected socket and tells who is at its other end.
    using identify_function = std::function<identity(socket_type&)>;

    stream_dialler(const boost::asio::any_io_executor& executor, const limits& bounds, identify_function identify,
                   dial_callback done)
        : socket_(executor), patience_(executor), bounds_(bounds), identify_(std::move(identify)),
          done_(std::move(done)) {}

    /// \pre there is one at least
    void start(std::vector<endpoint_type> where) { start(std::move(where), bounds_.connect); }
    /// With so much of the time left.
    void start(std::vector<endpoint_type> where, std::chrono::milliseconds left) {
        where_ = std::move(where);
        patience_.expires_after(left);
        patience_.async_wait([self = this->shared_from_this()](boost::system::error_code code) {
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
        patience_.cancel();
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
            socket_.remote_endpoint(code); // Asio takes a Unix socket for connected whose listener's queue was full
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
        patience_.cancel();
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
    boost::asio::steady_timer patience_;
    limits bounds_;
    identify_function identify_;
    dial_callback done_;
    std::vector<endpoint_type> where_;
    std::size_t tried_ = 0;
};

} // namespace cles::transport
