// SPDX-License-Identifier: BSL-1.0
#include "shell/feed_links.hpp"

#include "core/ignored_reply.hpp"
#include "protocol/message.hpp"
#include "shell/engine.hpp"
#include "shell/route.hpp"

#include <boost/asio/post.hpp>

#include <optional>
#include <utility>

namespace cles::shell {
namespace {

/// The answer to a feed's BIND. The feed lives as long as its handle.
class bind_reply final : public detail::pending {
  public:
    /// `asked`: when the BIND was sent by datagram; nothing for a stream.
    bind_reply(std::weak_ptr<detail::engine> host, std::weak_ptr<detail::feed_control> handle, core::feed_machine& feed,
               std::optional<time_point> asked)
        : host_(std::move(host)), handle_(std::move(handle)), feed_(feed), asked_(asked) {}

    verdict offer(std::string_view json) override {
        if (!detail::is_valid_answer(json)) {
            return verdict::malformed;
        }
        const std::unique_ptr<bind_reply> self{this};
        const auto host = host_.lock();
        const auto alive = handle_.lock();
        if (host && alive) {
            bound(*host, json);
        }
        return verdict::completed;
    }

    void fail(boost::system::error_code code, std::string_view message) override {
        const std::unique_ptr<bind_reply> self{this};
        const auto host = host_.lock();
        const auto alive = handle_.lock();
        if (!host || !alive || feed_.closed()) {
            return;
        }
        const std::string text{message};
        if (feed_.is_bound_without_value(code)) {
            bound(*host, "{}");
        } else {
            if (code == errc::deadline) { // the publisher may still answer, and would send updates for ever
                host->feeds().unbind(feed_);
            } else {
                host->feeds().detach(feed_);
            }
            feed_.on_refused(code, text, host->now());
        }
    }
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

  private:
    void bound(const detail::engine& host, std::string_view last) {
        feed_.on_bound(last);
        if (asked_) {
            feed_.on_leased(*asked_, host.bounds().lease);
        }
    }

    std::weak_ptr<detail::engine> host_;
    std::weak_ptr<detail::feed_control> handle_;
    core::feed_machine& feed_;
    std::optional<time_point> asked_;
};

/// The answer to a feed's BIND that renews its lease.
class renewal_reply final : public detail::pending {
  public:
    renewal_reply(std::weak_ptr<detail::engine> host, std::weak_ptr<detail::feed_control> handle,
                  core::feed_machine& feed, time_point asked)
        : host_(std::move(host)), handle_(std::move(handle)), feed_(feed), asked_(asked) {}

    verdict offer(std::string_view json) override {
        if (!detail::is_valid_answer(json)) {
            return verdict::malformed;
        }
        const std::unique_ptr<renewal_reply> self{this};
        if (const auto alive = handle_.lock()) {
            feed_.on_renewed(asked_);
        }
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        const std::unique_ptr<renewal_reply> self{this};
        const auto host = host_.lock();
        const auto alive = handle_.lock();
        if (host && alive) {
            const std::string text{message};
            feed_.on_renewal_refused(asked_, code, text, host->now());
        }
    }
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

  private:
    std::weak_ptr<detail::engine> host_;
    std::weak_ptr<detail::feed_control> handle_;
    core::feed_machine& feed_;
    time_point asked_;
};

} // namespace

void feed_links::enter(core::feed_machine& feed, std::weak_ptr<detail::feed_control> handle, feed_terms terms) {
    feeds_.insert_or_assign(&feed, entry{std::move(handle), std::move(terms), {}, 0});
}

void feed_links::leave(core::feed_machine& feed) { feeds_.erase(&feed); }

void feed_links::refuse_later(core::feed_machine& feed, boost::system::error_code code, const std::string& why) {
    boost::asio::post(engine_.executor(),
                      [host = engine_.shared_from_this(), handle = feeds_.at(&feed).handle.lock(), &feed, code, why] {
                          feed.on_refused(code, why, host->now());
                          host->settle();
                      });
}

void feed_links::bind(core::feed_machine& feed) {
    const auto found = feeds_.find(&feed);
    if (found == feeds_.end()) {
        return;
    }
    if (engine_.stopped()) {
        refuse_later(feed, errc::stopped, "the service has been stopped");
        return;
    }
    boost::system::error_code code;
    std::string why;
    auto* r = engine_.routes().to(feed.target(), found->second.terms.at, false, code, why);
    if (r == nullptr) {
        refuse_later(feed, code, why);
        return;
    }
    r->connect(feed,
               [host = engine_.shared_from_this(), handle = found->second.handle.lock(), &feed](
                   const std::shared_ptr<connection>& c, boost::system::error_code failed, std::string_view message) {
                   if (feed.closed()) {
                       return;
                   }
                   if (c) {
                       host->feeds().send_bind(feed, c);
                   } else {
                       feed.on_refused(failed, message, host->now());
                   }
               });
    engine_.settle();
}

void feed_links::send_bind(core::feed_machine& feed, const std::shared_ptr<connection>& c) {
    auto& e = feeds_.at(&feed);
    e.on = c;
    auto limit = e.terms.deadline;
    if (limit.count() <= 0) {
        limit = std::chrono::milliseconds{protocol::default_deadline_ms};
    }
    const auto now = engine_.now();
    const auto asked = c->datagram() == 0 ? std::nullopt : std::optional{now};
    c->bind(feed, bind_text(e, *c), now + limit,
            detail::pending_ptr{new bind_reply(engine_.weak_from_this(), e.handle, feed, asked)});
}

protocol::request_text feed_links::bind_text(entry& e, const connection& c) {
    protocol::request_text request{.verb = verb::bind,
                                   .noun = e.terms.noun,
                                   .id = engine_.draw_id(),
                                   .every_ms = e.terms.every_ms,
                                   .keep = e.terms.keep,
                                   .adverbs = e.terms.adverbs};
    if (c.datagram() != 0) {
        request.lease_ms = static_cast<std::uint32_t>(engine_.bounds().lease.count());
        e.asking = request.id;
    }
    return request;
}

void feed_links::renew(core::feed_machine& feed, time_point until) {
    const auto found = feeds_.find(&feed);
    if (found == feeds_.end()) {
        return;
    }
    if (const auto c = found->second.on.lock()) { // else its loss has been told
        const auto now = engine_.now();
        const auto request = bind_text(found->second, *c);
        c->session().asking().send(
            request, until, now,
            detail::pending_ptr{new renewal_reply(engine_.weak_from_this(), found->second.handle, feed, now)});
        engine_.settle();
    }
}

void feed_links::detach(core::feed_machine& feed) {
    const auto found = feeds_.find(&feed);
    if (found != feeds_.end()) {
        if (const auto c = found->second.on.lock()) {
            c->unbind(feed);
            if (const auto asking = std::exchange(found->second.asking, 0)) {
                c->session().asking().drop(asking); // a copy of it would bind again
            }
        }
        found->second.on.reset();
    }
}

void feed_links::unbind(core::feed_machine& feed) {
    const auto found = feeds_.find(&feed);
    if (found == feeds_.end()) {
        return;
    }
    engine_.routes().forget(feed);
    const auto c = found->second.on.lock();
    const auto now = engine_.now();
    detach(feed);
    if (c && c->usable() && !engine_.stopped()) {
        c->session().asking().send(
            {.verb = verb::bind, .noun = found->second.terms.noun, .id = engine_.draw_id(), .lease_ms = 0},
            now + std::chrono::milliseconds{protocol::default_deadline_ms}, now,
            detail::pending_ptr{new core::ignored_reply});
    }
}

void feed_links::stop() {
    const auto feeds = feeds_;
    for (const auto& [feed, e] : feeds) {
        if (const auto handle = e.handle.lock()) {
            // Taken out of the feed, which they may own: else neither would go if the context goes without running.
            feed->abandon().fail(engine_.completions(), errc::stopped);
        }
    }
}

} // namespace cles::shell
