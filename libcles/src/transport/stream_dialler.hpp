// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/link.hpp>

#include "transport/stream_link.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/steady_timer.hpp>

#include <functional>
#include <memory>
#include <utility>

namespace cles::transport {

/// Makes one connection, within the time that the limits give.
template <class Protocol>
class stream_dialler : public std::enable_shared_from_this<stream_dialler<Protocol>> {
  public:
    using socket_type = typename Protocol::socket;
    using endpoint_type = typename Protocol::endpoint;
    using prepare_function = std::function<void(socket_type&)>;

    stream_dialler(const boost::asio::any_io_executor& executor, const limits& bounds, identity peer,
                   prepare_function connected, dial_callback done)
        : socket_(executor), patience_(executor), bounds_(bounds), peer_(std::move(peer)),
          connected_(std::move(connected)), done_(std::move(done)) {}

    void start(const endpoint_type& where) {
        patience_.expires_after(bounds_.connect);
        patience_.async_wait([self = this->shared_from_this()](boost::system::error_code code) {
            if (!code) {
                self->end(boost::asio::error::timed_out);
            }
        });
        socket_.async_connect(where,
                              [self = this->shared_from_this()](boost::system::error_code code) { self->end(code); });
    }

    void give_up() {
        done_ = nullptr;
        boost::system::error_code ignored;
        socket_.close(ignored);
        patience_.cancel();
    }

  private:
    void end(boost::system::error_code code) {
        auto done = std::exchange(done_, nullptr);
        patience_.cancel();
        if (!done) {
            return;
        }
        if (!code) {
            socket_.remote_endpoint(code); // Asio takes a Unix socket for connected whose listener's queue was full
            code = code == boost::asio::error::not_connected ? boost::asio::error::try_again : code;
        }
        if (code) {
            boost::system::error_code ignored;
            socket_.close(ignored);
            done(code, nullptr);
            return;
        }
        connected_(socket_);
        done({}, std::make_shared<stream_link>(std::move(socket_), std::move(peer_), bounds_));
    }

    socket_type socket_;
    boost::asio::steady_timer patience_;
    limits bounds_;
    identity peer_;
    prepare_function connected_;
    dial_callback done_;
};

} // namespace cles::transport
