// SPDX-License-Identifier: BSL-1.0
#include "api/feed_handle.hpp"

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
    // The feed may be closed from inside its own event: functions up the stack still need it.
    asio::post(host_->executor(), [self = shared_from_this()] {});
}

std::shared_ptr<detail::feed_control> make_refused_feed(std::shared_ptr<detail::engine> host,
                                                        boost::system::error_code code, std::string message) {
    return std::make_shared<refused_feed>(std::move(host), code, std::move(message));
}

namespace asio = boost::asio;

group_feed_handle::group_feed_handle(std::shared_ptr<detail::engine> host, std::string target, std::string path)
    : host_(std::move(host)), feed_(host_->bounds(), host_->completions(), std::move(target), std::move(path)) {}

group_feed_handle::~group_feed_handle() { leave(); }

void group_feed_handle::leave() {
    if (auto* group = std::exchange(left_, true) ? nullptr : host_->group()) {
        group->dispatcher().feeds().remove(feed_);
    }
}

void group_feed_handle::start(detail::pending_ptr bound) {
    if (host_->stopped()) {
        static_cast<void>(feed_.mail().close());
        host_->fail_later(std::move(bound), errc::stopped, "the service has been stopped");
        return;
    }
    host_->group()->dispatcher().feeds().add(feed_, host_->now());
    starting_ = true;
    asio::post(host_->executor(), [bound = std::move(bound), self = shared_from_this()]() mutable {
        self->starting_ = false;
        if (self->feed_.mail().closed()) {
            const bool stopped = self->host_->stopped();
            bound.release()->fail(stopped ? errc::stopped : errc::cancelled, "the feed was closed");
        } else {
            bound.release()->offer("{}");
        }
    });
}

void group_feed_handle::next(detail::event_ptr operation) {
    fetch_next(feed_.mail(), executor(), shared_from_this(), std::move(operation));
}

void group_feed_handle::cancel_start() {
    if (starting_) {
        close();
    }
}

void group_feed_handle::close() {
    leave();
    if (auto waiting = feed_.mail().close()) {
        host_->completions().put(core::completion{
            core::completion::event_failure{std::move(waiting), errc::cancelled, "the feed was closed"}});
    }
    // The feed may be closed from inside its own event: functions up the stack still need it.
    asio::post(host_->executor(), [self = shared_from_this()] {});
}

namespace {

/// Why a noun cannot be bound through the group; `message` is empty if it can.
struct refusal {
    errc code = errc::no_target;
    std::string message;
};

refusal objection_to(detail::engine& host, const protocol::noun_view& noun, const bind_options& options) {
    const std::string target{noun.target};
    if (!options.at_.empty()) {
        return {errc::bad_request, "a binding by multicast takes no address: '" + options.at_ + "'"};
    }
    if (noun.task == "cles") {
        return {errc::bad_request, "the task 'cles' cannot be bound by multicast"};
    }
    if (target == "self" || target == "any") {
        return {errc::no_target, "a binding by multicast needs a node's name or 'all', not '" + target + "'"};
    }
    if (target == host.node().name) {
        return {errc::no_target, "a node cannot bind its own tasks by multicast"};
    }
    if (host.group() == nullptr) {
        return {errc::no_target, "'" + target + ":" + std::string{noun.path} +
                                     "' needs multicast, which is off: set an interface in service_options::multicast"};
    }
    return {};
}

} // namespace

std::shared_ptr<detail::feed_control> make_group_feed(const std::shared_ptr<detail::engine>& host,
                                                      const protocol::noun_view& noun, std::string path,
                                                      const bind_options& options) {
    if (auto why = objection_to(*host, noun, options); !why.message.empty()) {
        return make_refused_feed(host, why.code, std::move(why.message));
    }
    return std::make_shared<group_feed_handle>(host, std::string{noun.target}, std::move(path));
}

} // namespace cles::api
