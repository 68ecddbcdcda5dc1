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

/// The connection to one endpoint.
class stream_dialler::attempt : public std::enable_shared_from_this<attempt> {
  public:
    attempt(stream_dialler& owner, std::size_t which)
        : owner_(std::static_pointer_cast<stream_dialler>(owner.shared_from_this())), socket_(owner.executor()),
          which_(which) {}

    [[nodiscard]] std::size_t which() const noexcept { return which_; }
    [[nodiscard]] stream_socket& socket() noexcept { return socket_; }
    [[nodiscard]] const std::shared_ptr<stream_link>& link() const noexcept { return link_; }

    void connect(const stream_address& where) {
        error_code code;
        open_private(socket_, where.protocol(), code);
        if (code) {
            post_call<&attempt::on_connected>(socket_.get_executor(), shared_from_this(), code);
        } else {
            socket_.async_connect(where, member_handler::calling<&attempt::on_connected>(shared_from_this()));
        }
    }
    void open(std::shared_ptr<stream_link> link) {
        link_ = std::move(link);
        link_->open([weak = weak_from_this()](error_code code) {
            const auto self = weak.lock();
            if (const auto owner = self ? self->owner_.lock() : nullptr) {
                owner->on_opened(*self, code);
            }
        });
    }
    void close() {
        owner_.reset();
        error_code ignored;
        socket_.close(ignored);
        if (link_) {
            link_->close();
        }
    }

  private:
    void on_connected(error_code code) {
        if (const auto owner = owner_.lock()) {
            owner->on_connected(*this, code);
        }
    }

    std::weak_ptr<stream_dialler> owner_;
    stream_socket socket_;
    std::size_t which_;
    std::shared_ptr<stream_link> link_; // while it is being opened
};

stream_dialler::stream_dialler(const asio::any_io_executor& executor, const limits& bounds, identify_function identify,
                               dial_callback done, codec_maker make_codec)
    : address_dialler(executor, bounds, asio::error::timed_out, std::move(done)), bounds_(bounds),
      identify_(std::move(identify)), make_codec_(std::move(make_codec)) {}

void stream_dialler::start(std::vector<stream_address> where, std::function<void(std::size_t)> answered) {
    where_ = std::move(where);
    begin_race(where_.size(), std::move(answered));
}

void stream_dialler::begin(std::size_t which) {
    attempts_.push_back(std::make_shared<attempt>(*this, which));
    attempts_.back()->connect(where_[which]);
}

void stream_dialler::on_connected(attempt& by, error_code code) {
    auto& socket = by.socket();
    if (!code) {
        socket.remote_endpoint(code); // Asio takes a Unix socket for connected if the listener's queue was full
        code = code == asio::error::not_connected ? asio::error::try_again : code;
    }
    if (code) {
        on_failed(by, code);
        return;
    }
    auto peer = identify_(socket);
    auto codec = make_codec_ ? make_codec_(peer) : nullptr;
    auto made = std::make_shared<stream_link>(std::move(socket), std::move(peer), bounds_, std::move(codec));
    if (make_codec_) {
        note_acceptance();
        continue_race();
        by.open(std::move(made));
    } else {
        complete(by, std::move(made));
    }
}

void stream_dialler::on_opened(attempt& by, error_code code) {
    if (code) {
        on_failed(by, code);
    } else {
        complete(by, by.link());
    }
}

void stream_dialler::on_failed(attempt& by, error_code code) {
    if (by.link()) {
        refusal_ = code; // says more than that other addresses cannot be reached
    }
    std::erase_if(attempts_, [&by](const auto& one) { return one.get() == &by; });
    note_failure(refusal_ ? refusal_ : code);
    continue_race();
}

void stream_dialler::complete(const attempt& by, link_ptr made) {
    const auto which = by.which();
    std::erase_if(attempts_, [&by](const auto& one) { return one.get() == &by; });
    win(which, std::move(made));
}

void stream_dialler::close_attempts() {
    for (const auto& one : std::exchange(attempts_, {})) {
        one->close();
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
