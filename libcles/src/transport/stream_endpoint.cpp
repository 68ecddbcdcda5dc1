// SPDX-License-Identifier: BSL-1.0
#include "transport/stream_endpoint.hpp"

#include "transport/member_handler.hpp"

#include <boost/asio/error.hpp>

#include <algorithm>
#include <chrono>
#include <utility>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

// --- Dialling ---

stream_dialler::stream_dialler(const asio::any_io_executor& executor, const limits& bounds, identify_function identify,
                               dial_callback done, codec_maker make_codec)
    : socket_(executor), timeout_(executor, bounds.connect), bounds_(bounds), identify_(std::move(identify)),
      done_(std::move(done)), make_codec_(std::move(make_codec)) {}

void stream_dialler::start(std::vector<stream_address> where) {
    where_ = std::move(where);
    wait_call<&stream_dialler::on_timeout>(timeout_, shared_from_this());
    connect();
}

void stream_dialler::on_timeout(error_code code) {
    if (!code) {
        fail(asio::error::timed_out);
    }
}

void stream_dialler::connect() {
    const auto& where = where_[tried_++];
    error_code code;
    open_private(socket_, where.protocol(), code);
    if (code) {
        post_call<&stream_dialler::on_connected>(socket_.get_executor(), shared_from_this(), code);
    } else {
        socket_.async_connect(where, member_handler::calling<&stream_dialler::on_connected>(shared_from_this()));
    }
}

void stream_dialler::on_connected(error_code code) {
    if (!done_) {
        return;
    }
    if (!code) {
        socket_.remote_endpoint(code); // Asio takes a Unix socket for connected if the listener's queue was full
        code = code == asio::error::not_connected ? asio::error::try_again : code;
    }
    if (code && tried_ < where_.size()) {
        error_code ignored;
        socket_.close(ignored);
        connect();
    } else if (code) {
        fail(code);
    } else {
        make_link();
    }
}

void stream_dialler::make_link() {
    auto peer = identify_(socket_);
    auto codec = make_codec_ ? make_codec_(peer) : nullptr;
    made_ = std::make_shared<stream_link>(std::move(socket_), std::move(peer), bounds_, std::move(codec));
    if (make_codec_) {
        made_->open([weak = weak_from_this()](error_code code) {
            if (const auto self = weak.lock()) {
                self->complete(code);
            }
        });
    } else {
        complete({});
    }
}

void stream_dialler::complete(error_code code) {
    const auto done = std::exchange(done_, nullptr);
    auto made = std::exchange(made_, nullptr);
    timeout_.cancel();
    if (done) {
        done(code, code ? nullptr : std::move(made));
    }
}

void stream_dialler::fail(error_code why) {
    const auto done = std::exchange(done_, nullptr);
    give_up();
    if (done) {
        done(why, nullptr);
    }
}

void stream_dialler::give_up() {
    done_ = nullptr;
    error_code ignored;
    socket_.close(ignored);
    timeout_.cancel();
    if (const auto made = std::exchange(made_, nullptr)) {
        made->close();
    }
}

// --- Accepting ---

namespace {

// Whether one connection failed before it was accepted (accept(2)): the next one may succeed. Other errors, such as a
// lack of descriptors, would recur at once.
bool is_the_peers(const error_code& code) {
    using namespace boost::system::errc;
    const auto all = {connection_aborted, connection_reset,    protocol_error, no_protocol_option,
                      host_unreachable,   network_unreachable, network_down,   operation_not_supported,
                      timed_out,          interrupted};
    return std::ranges::any_of(all, [&](errc_t one) { return code == one; });
}

} // namespace

stream_acceptor::stream_acceptor(listening_socket socket, url local, const limits& bounds, identify_function identify,
                                 codec_maker make_codec)
    : acceptor_(std::move(socket)), protocol_(acceptor_.local_endpoint().protocol()), local_(std::move(local)),
      pause_(acceptor_.get_executor()), bounds_(bounds), identify_(std::move(identify)),
      make_codec_(std::move(make_codec)) {}

void stream_acceptor::start(std::function<void(link_ptr)> on_link) {
    on_link_ = std::move(on_link);
    acceptor_.native_non_blocking(true);
    wait();
}

void stream_acceptor::accept_waiting() {
    error_code code;
    while (accept_one(code)) {
    }
}

void stream_acceptor::close() {
    error_code ignored;
    acceptor_.close(ignored); // ends the wait, which releases the callback
    pause_.cancel();
}

void stream_acceptor::hand_over(stream_socket socket) {
    auto peer = identify_(socket);
    auto codec = make_codec_ ? make_codec_(peer) : nullptr;
    const auto made = std::make_shared<stream_link>(std::move(socket), std::move(peer), bounds_, std::move(codec));
    if (make_codec_) {
        made->open();
    }
    on_link_(made);
}

void stream_acceptor::wait() {
    wait_call<&stream_acceptor::on_readable>(acceptor_, asio::socket_base::wait_read, shared_from_this());
}

// Other tasks of the executor have their turn after some connections.
void stream_acceptor::on_readable(error_code code) {
    constexpr int per_turn = 16;
    for (int left = per_turn; left != 0 && accept_one(code); --left) {
    }
    if (!acceptor_.is_open() || !on_link_) {
        on_link_ = nullptr;
    } else if (!code || code == asio::error::would_block) {
        wait();
    } else {
        accept_later();
    }
}

bool stream_acceptor::accept_one(error_code& code) {
    if (code || !on_link_ || !acceptor_.is_open()) {
        return false;
    }
    stream_socket socket{acceptor_.get_executor()};
    accept_private(acceptor_, protocol_, socket, code);
    if (!code) {
        hand_over(std::move(socket));
    } else if (is_the_peers(code)) {
        code.clear();
    }
    return !code;
}

void stream_acceptor::accept_later() {
    pause_.expires_after(std::chrono::milliseconds{100});
    wait_call<&stream_acceptor::after_pause>(pause_, shared_from_this());
}

void stream_acceptor::after_pause(error_code code) {
    if (!code && acceptor_.is_open()) {
        wait();
    }
}

} // namespace cles::transport
