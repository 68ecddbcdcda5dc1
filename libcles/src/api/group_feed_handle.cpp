// SPDX-License-Identifier: BSL-1.0
#include "api/group_feed_handle.hpp"

#include "api/feed_handle.hpp"
#include "api/fetching.hpp"

#include <boost/asio/post.hpp>

#include <utility>

namespace cles::api {
namespace asio = boost::asio;

group_feed_handle::group_feed_handle(std::shared_ptr<detail::engine> host, std::string target, std::string path)
    : host_(std::move(host)), feed_(host_->bounds(), host_->completions(), std::move(target), std::move(path)) {}

group_feed_handle::~group_feed_handle() { leave(); }

void group_feed_handle::leave() {
    if (auto* group = std::exchange(left_, true) ? nullptr : host_->group()) {
        group->intake().feeds().remove(feed_);
        host_->settle();
    }
}

void group_feed_handle::start(detail::pending_ptr bound) {
    if (host_->stopped()) {
        static_cast<void>(feed_.mail().close());
        host_->fail_later(std::move(bound), errc::stopped, "the service has been stopped");
        return;
    }
    host_->group()->intake().feeds().add(feed_, host_->now());
    host_->settle();
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
    // The feed may be closed from inside its own event: what is up the stack still needs it.
    asio::post(host_->executor(), [self = shared_from_this()] {});
}

namespace {

/// Why a noun cannot be bound by the group; `message` is empty where it can.
struct refusal {
    errc code = errc::no_target;
    std::string message;
};

refusal objection_to(detail::engine& host, const protocol::noun_view& noun, const bind_options& options) {
    const std::string target{noun.target};
    if (!options.at_.empty()) {
        return {errc::bad_request, "a binding by multicast has no address: '" + options.at_ + "'"};
    }
    if (noun.task == "cles") {
        return {errc::bad_request, "the task 'cles' cannot be bound by multicast"};
    }
    if (target == "self" || target == "any") {
        return {errc::no_target, "by multicast a node's name is bound, or 'all', and not '" + target + "'"};
    }
    if (target == host.node().name) {
        return {errc::no_target, "by multicast a node does not hear itself"};
    }
    if (host.group() == nullptr) {
        return {errc::no_target, "'" + target + ":" + std::string{noun.path} +
                                     "' goes by multicast, which is off: give service_options::multicast an interface"};
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
