// SPDX-License-Identifier: BSL-1.0
#include "api/feed_handle.hpp"

#include "api/fetching.hpp"

#include <boost/asio/post.hpp>

#include <random>
#include <utility>

namespace cles::api {
namespace asio = boost::asio;

namespace {

std::uint32_t seed() {
    thread_local std::minstd_rand draw{std::random_device{}()};
    return static_cast<std::uint32_t>(draw());
}

class refused_feed final : public detail::feed_control {
  public:
    refused_feed(std::shared_ptr<detail::engine> host, boost::system::error_code code, std::string message)
        : host_(std::move(host)), code_(code), message_(std::move(message)) {}

    void start(detail::pending_ptr bound) override { host_->fail_later(std::move(bound), code_, message_); }
    void next(detail::event_ptr operation) override {
        asio::post(host_->executor(), [operation = std::move(operation), code = code_, message = message_]() mutable {
            operation.release()->fail(code, message);
        });
    }
    void cancel_start() override {}
    void cancel(const detail::pending_event*) override {}
    void close() override {}
    [[nodiscard]] const asio::any_io_executor& executor() const override { return host_->executor(); }

  private:
    std::shared_ptr<detail::engine> host_;
    boost::system::error_code code_;
    std::string message_;
};

} // namespace

feed_handle::feed_handle(std::shared_ptr<detail::engine> host, std::string target, std::string path, bool thinned)
    : host_(std::move(host)), machine_(host_->feeds(), host_->deadlines(), host_->completions(), host_->bounds(),
                                       std::move(target), std::move(path), thinned, seed()) {}

feed_handle::~feed_handle() {
    if (!left_) {
        host_->feeds().leave(machine_);
    }
}

void feed_handle::start(detail::pending_ptr bound) { machine_.start(std::move(bound)); }

void feed_handle::next(detail::event_ptr operation) {
    fetch_next(machine_.mail(), executor(), shared_from_this(), std::move(operation));
}

void feed_handle::cancel_start() {
    if (machine_.is_starting()) {
        close();
    }
}

void feed_handle::close() {
    machine_.close(errc::cancelled);
    host_->feeds().leave(machine_);
    left_ = true;
    // The feed may be closed from inside its own event: what is up the stack still needs it.
    asio::post(host_->executor(), [self = shared_from_this()] {});
}

std::shared_ptr<detail::feed_control> make_refused_feed(std::shared_ptr<detail::engine> host,
                                                        boost::system::error_code code, std::string message) {
    return std::make_shared<refused_feed>(std::move(host), code, std::move(message));
}

} // namespace cles::api
