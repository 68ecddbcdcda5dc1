// SPDX-License-Identifier: BSL-1.0
#include "simulation/feed_ties.hpp"

#include "core/ignored_reply.hpp"
#include "simulation/node_run.hpp"

#include <optional>
#include <utility>

namespace cles::simulation {
namespace {

/// The answer to a feed's BIND.
class bind_reply final : public detail::pending {
  public:
    bind_reply(node_run& host, std::weak_ptr<void> alive, core::feed_machine& feed, std::optional<time_point> asked)
        : node_(host), alive_(std::move(alive)), feed_(feed), asked_(asked) {}

    verdict offer(std::string_view json) override {
        if (!detail::is_valid_answer(json)) {
            return verdict::malformed;
        }
        const std::unique_ptr<bind_reply> self{this};
        if (const auto alive = alive_.lock()) {
            bound(json);
        }
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        const std::unique_ptr<bind_reply> self{this};
        const auto alive = alive_.lock();
        if (!alive || feed_.closed()) {
            return;
        }
        const std::string text{message};
        if (feed_.is_bound_without_value(code)) {
            bound("{}");
        } else {
            if (code == errc::deadline) {
                node_.feeds().unbind(feed_);
            } else {
                node_.feeds().detach(feed_);
            }
            feed_.on_refused(code, text, node_.now());
        }
    }
    void discard() noexcept override { delete this; }

  private:
    void bound(std::string_view last) {
        feed_.on_bound(last);
        if (asked_) {
            feed_.on_leased(*asked_, node_.bounds().lease);
        }
    }

    node_run& node_;
    std::weak_ptr<void> alive_;
    core::feed_machine& feed_;
    std::optional<time_point> asked_;
};

/// The answer to a feed's BIND that renews its lease.
class renewal_reply final : public detail::pending {
  public:
    renewal_reply(node_run& host, std::weak_ptr<void> alive, core::feed_machine& feed, time_point asked)
        : node_(host), alive_(std::move(alive)), feed_(feed), asked_(asked) {}

    verdict offer(std::string_view json) override {
        if (!detail::is_valid_answer(json)) {
            return verdict::malformed;
        }
        const std::unique_ptr<renewal_reply> self{this};
        if (const auto alive = alive_.lock()) {
            feed_.on_renewed(asked_);
        }
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        const std::unique_ptr<renewal_reply> self{this};
        if (const auto alive = alive_.lock()) {
            const std::string text{message};
            feed_.on_renewal_refused(asked_, code, text, node_.now());
        }
    }
    void discard() noexcept override { delete this; }

  private:
    node_run& node_;
    std::weak_ptr<void> alive_;
    core::feed_machine& feed_;
    time_point asked_;
};

} // namespace

void feed_ties::enter(core::feed_machine& feed, std::weak_ptr<void> alive, feed_terms terms) {
    feeds_.insert_or_assign(&feed, entry{std::move(alive), std::move(terms), {}, 0, false});
}

void feed_ties::bind(core::feed_machine& feed) {
    const auto found = feeds_.find(&feed);
    if (found == feeds_.end()) {
        return;
    }
    if (found->second.was_bound && node_.fault() == planted::rebind_forgotten) {
        return;
    }
    const auto& terms = found->second.terms;
    node_.route_to(terms.to, terms.by)
        .connect(feed, [this, alive = found->second.alive.lock(), &feed](const std::shared_ptr<connection>& c) {
            if (feed.closed()) {
                return;
            }
            if (c) {
                send_bind(feed, c);
            } else {
                feed.on_refused(errc::unavailable, "cannot connect", node_.now());
            }
        });
}

void feed_ties::send_bind(core::feed_machine& feed, const std::shared_ptr<connection>& c) {
    auto& e = feeds_.at(&feed);
    e.on = c;
    e.was_bound = true;
    const auto now = node_.now();
    const auto asked = c->datagram() == 0 ? std::nullopt : std::optional{now};
    c->bind(feed, bind_text(e, *c), now + std::chrono::milliseconds{protocol::default_deadline_ms},
            detail::pending_ptr{new bind_reply(node_, e.alive, feed, asked)});
}

protocol::request_text feed_ties::bind_text(entry& e, const connection& c) {
    protocol::request_text request{.verb = verb::bind,
                                   .noun = e.terms.noun,
                                   .id = node_.draw_id(),
                                   .every_ms = e.terms.every_ms,
                                   .keep = e.terms.keep};
    if (c.datagram() != 0) {
        request.lease_ms = static_cast<std::uint32_t>(node_.bounds().lease.count());
        e.asking = request.id;
    }
    return request;
}

void feed_ties::renew(core::feed_machine& feed, time_point until) {
    const auto found = feeds_.find(&feed);
    if (found == feeds_.end()) {
        return;
    }
    if (const auto c = found->second.on.lock()) {
        const auto now = node_.now();
        const auto request = bind_text(found->second, *c);
        c->session().asking().send(request, until, now,
                                   detail::pending_ptr{new renewal_reply(node_, found->second.alive, feed, now)});
    }
}

void feed_ties::detach(core::feed_machine& feed) {
    const auto found = feeds_.find(&feed);
    if (found != feeds_.end()) {
        if (const auto c = found->second.on.lock()) {
            c->unbind(feed);
            if (const auto asking = std::exchange(found->second.asking, 0)) {
                c->session().asking().drop(asking);
            }
        }
        found->second.on.reset();
    }
}

void feed_ties::unbind(core::feed_machine& feed) {
    const auto found = feeds_.find(&feed);
    if (found == feeds_.end()) {
        return;
    }
    node_.forget_waiting(feed);
    const auto c = found->second.on.lock();
    const auto now = node_.now();
    detach(feed);
    if (c && c->usable()) {
        c->session().asking().send(
            {.verb = verb::bind, .noun = found->second.terms.noun, .id = node_.draw_id(), .lease_ms = 0},
            now + std::chrono::milliseconds{protocol::default_deadline_ms}, now,
            detail::pending_ptr{new core::ignored_reply});
    }
}

} // namespace cles::simulation
