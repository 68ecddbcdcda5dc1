// SPDX-License-Identifier: BSL-1.0
#include "shell/feed_links.hpp"

#include <cles/json_reader.hpp>

#include "core/ignored_reply.hpp"
#include "core/later.hpp"
#include "protocol/message.hpp"
#include "shell/local_node.hpp"
#include "shell/option_checks.hpp"
#include "shell/route.hpp"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace cles::shell {
namespace {

/// Whether what `PULL self:cles` tells names the feature.
bool lists_mark(std::string_view description) {
    json_reader reader{description, detail::answer_depth};
    bool found = false;
    std::string_view key;
    reader.begin_object();
    while (reader.next_key(key)) {
        if (key != "features" || reader.peek() != json_reader::kind::array) {
            reader.skip();
            continue;
        }
        reader.begin_array();
        while (reader.next_element()) {
            std::string_view feature;
            if (reader.peek() != json_reader::kind::string) {
                reader.skip();
            } else if (reader.read(feature)) {
                found = found || feature == "mark";
            }
        }
    }
    return found;
}

/// What the mark of the last value is for, where it was asked for.
enum class marking : std::uint8_t {
    none,
    as_update, ///< the value is an update where it is news
    up_to_it,  ///< what comes up to it is old: it was queued for those whose binding is shared
};

/// The answer to a feed's BIND. The feed lives as long as its handle.
class bind_reply final : public detail::pending {
  public:
    /// `asked`: when the BIND was sent by datagram; nothing for a stream.
    bind_reply(std::weak_ptr<local_node> host, std::weak_ptr<void> handle, core::feed_machine& feed,
               std::optional<time_point> asked, marking marks)
        : host_(std::move(host)), handle_(std::move(handle)), feed_(feed), asked_(asked), marks_(marks) {}

    verdict offer(std::string_view json) override { return take(json, {}); }
    verdict offer_marked(std::string_view json, const update_mark& mark) override { return take(json, mark); }

    void fail(boost::system::error_code code, std::string_view message) override {
        const std::unique_ptr<bind_reply> self{this};
        const auto host = host_.lock();
        const auto alive = handle_.lock();
        if (!host || !alive || feed_.closed()) {
            return;
        }
        const std::string text{message};
        if (feed_.is_bound_without_value(code)) {
            bound(*host, "{}", {});
        } else {
            // It may be bound all the same, and would be sent updates for ever: where the publisher still answers, or
            // by those who shared its binding and have left it to this one.
            if (code == errc::deadline || feed_.has_shared()) {
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
    verdict take(std::string_view json, const std::optional<update_mark>& mark) {
        if (!detail::is_valid_answer(json)) {
            return verdict::malformed;
        }
        const std::unique_ptr<bind_reply> self{this};
        const auto host = host_.lock();
        const auto alive = handle_.lock();
        if (host && alive) {
            bound(*host, json, mark);
        }
        return verdict::completed;
    }

    void bound(const local_node& host, std::string_view last, const std::optional<update_mark>& mark) {
        if (mark && marks_ == marking::up_to_it) {
            feed_.skip_to(*mark);
        }
        feed_.on_bound(last, marks_ == marking::as_update ? mark : std::nullopt);
        if (asked_) {
            feed_.on_leased(*asked_, host.bounds().lease);
        }
    }

    std::weak_ptr<local_node> host_;
    std::weak_ptr<void> handle_;
    core::feed_machine& feed_;
    std::optional<time_point> asked_;
    marking marks_;
};

/// The answer to a feed's BIND that renews its lease.
class renewal_reply final : public detail::pending {
  public:
    renewal_reply(std::weak_ptr<local_node> host, std::weak_ptr<void> handle, core::feed_machine& feed,
                  time_point asked)
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
    std::weak_ptr<local_node> host_;
    std::weak_ptr<void> handle_;
    core::feed_machine& feed_;
    time_point asked_;
};

} // namespace

/// What a node says of itself, before a feed is bound there that asks for more than every node can say.
class feed_links::features_reply final : public detail::pending {
  public:
    features_reply(std::weak_ptr<local_node> host, std::weak_ptr<void> handle, core::feed_machine& feed,
                   std::weak_ptr<connection> on)
        : host_(std::move(host)), handle_(std::move(handle)), feed_(feed), on_(std::move(on)) {}

    verdict offer(std::string_view json) override {
        if (!detail::is_valid_answer(json)) {
            return verdict::malformed;
        }
        go_on(lists_mark(json));
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        if (code != errc::unavailable && code != errc::busy) {
            go_on(false);
            return;
        }
        const std::unique_ptr<features_reply> self{this};
        const auto host = host_.lock();
        if (const auto alive = handle_.lock(); host && alive) {
            const std::string text{message};
            feed_.on_refused(code, text, host->now());
            host->settle();
        }
    }
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

  private:
    void go_on(bool marks) {
        const std::unique_ptr<features_reply> self{this};
        if (const auto c = on_.lock()) {
            c->set_marks(marks);
        }
        const auto host = host_.lock();
        if (const auto alive = handle_.lock(); host && alive && !feed_.closed()) {
            host->feeds().bind(feed_);
        }
    }

    std::weak_ptr<local_node> host_;
    std::weak_ptr<void> handle_;
    core::feed_machine& feed_;
    std::weak_ptr<connection> on_;
};

void feed_links::enter(core::feed_machine& feed, std::weak_ptr<void> handle, feed_terms terms) {
    feed.share_by("every=" + std::to_string(terms.every_ms) + " keep=" + std::to_string(terms.keep) + " " +
                  terms.adverbs);
    feeds_.insert_or_assign(&feed, entry{std::move(handle), std::move(terms), {}, {}, 0, {}, ++last_number_});
}

void feed_links::leave(core::feed_machine& feed) { feeds_.erase(&feed); }

void feed_links::refuse_later(core::feed_machine& feed, boost::system::error_code code, const std::string& why) {
    core::post(host_.environment(),
               [host = host_.shared_from_this(), handle = feeds_.at(&feed).handle.lock(), &feed, code, why] {
                   feed.on_refused(code, why, host->now());
                   host->settle();
               });
}

void feed_links::bind(core::feed_machine& feed) {
    const auto found = feeds_.find(&feed);
    if (found == feeds_.end()) {
        return;
    }
    if (host_.stopped()) {
        refuse_later(feed, errc::stopped, "the service has been stopped");
        return;
    }
    boost::system::error_code code;
    std::string why;
    auto* r = host_.routes().to(feed.target(), found->second.terms.at, false, code, why);
    if (r == nullptr) {
        refuse_later(feed, code, why);
        return;
    }
    found->second.at = r->address();
    r->connect(feed,
               [host = host_.shared_from_this(), handle = found->second.handle.lock(), &feed](
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
    host_.settle();
}

void feed_links::send_bind(core::feed_machine& feed, const std::shared_ptr<connection>& c) {
    auto& e = feeds_.at(&feed);
    // Of a binding that is there, updates may be queued at the publisher that are older than the value it answers with.
    // (The answer of `all` is of several publishers, and says in its body how old each value is.)
    const bool joins = !feed.was_bound() && feed.target() != "all" && c->session().bound().has_bound_for(feed);
    auto marks = e.terms.marked ? marking::as_update : joins ? marking::up_to_it : marking::none;
    if (marks != marking::none && !c->marks()) {
        ask_for_features(feed, c);
        return;
    }
    if (marks != marking::none && !*c->marks()) {
        marks = marking::none;
    }
    e.on = c;
    const auto now = host_.now();
    const auto asked = c->datagram() == 0 ? std::nullopt : std::optional{now};
    auto request = bind_text(e, *c);
    const auto adverbs = e.terms.adverbs + (e.terms.adverbs.empty() ? "mark=yes" : " mark=yes");
    if (marks != marking::none) {
        request.adverbs = adverbs;
    }
    const auto whole = core::later(now, time_limit(e.terms.deadline, verb::bind));
    const auto due = std::exchange(e.due, {}).value_or(whole);
    c->bind(feed, request, due > now ? due : whole,
            detail::pending_ptr{new bind_reply(host_.weak_from_this(), e.handle, feed, asked, marks)});
}

void feed_links::ask_for_features(core::feed_machine& feed, const std::shared_ptr<connection>& c) {
    auto& e = feeds_.at(&feed);
    const auto now = host_.now();
    const auto whole = time_limit(e.terms.deadline, verb::bind);
    const auto limit = std::min(time_limit({}, verb::pull), whole);
    e.due = core::later(now, whole);
    c->session().asking().send({.verb = verb::pull, .noun = "self:cles", .id = host_.draw_id()},
                               core::later(now, limit), now,
                               detail::pending_ptr{new features_reply(host_.weak_from_this(), e.handle, feed, c)});
}

protocol::request_text feed_links::bind_text(entry& e, const connection& c) {
    protocol::request_text request{.verb = verb::bind,
                                   .noun = e.terms.noun,
                                   .id = host_.draw_id(),
                                   .every_ms = e.terms.every_ms,
                                   .keep = e.terms.keep,
                                   .adverbs = e.terms.adverbs};
    if (c.datagram() != 0) {
        request.lease_ms = static_cast<std::uint32_t>(host_.bounds().lease.count());
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
        const auto now = host_.now();
        const auto request = bind_text(found->second, *c);
        c->session().asking().send(
            request, until, now,
            detail::pending_ptr{new renewal_reply(host_.weak_from_this(), found->second.handle, feed, now)});
        host_.settle();
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
    host_.routes().forget(feed);
    const auto c = found->second.on.lock();
    const auto now = host_.now();
    detach(feed);
    // Another feed may share the binding.
    if (c && c->usable() && !host_.stopped() && !c->session().bound().has(feed.target(), feed.path())) {
        c->session().asking().send(
            {.verb = verb::bind, .noun = found->second.terms.noun, .id = host_.draw_id(), .lease_ms = 0},
            core::later(now, time_limit({}, verb::bind)), now, detail::pending_ptr{new core::ignored_reply});
    }
}

void feed_links::on_new_run(std::string_view node, bool replaced) {
    const std::string where{host_.neighbours().find(node).value_or(std::string_view{})};
    struct concern {
        core::feed_machine* feed;
        std::weak_ptr<void> handle;
        bool elsewhere;
    };
    std::vector<concern> concerned;
    for (auto* feed : in_order()) {
        const auto& e = feeds_.at(feed);
        if (feed->target() == node && e.terms.at.empty()) {
            concerned.push_back({feed, e.handle, e.at != where});
        }
    }
    const auto now = host_.now();
    for (const auto& [feed, handle, elsewhere] : concerned) {
        const auto alive = handle.lock(); // what another was told may have closed this one
        if (!alive || !feeds_.contains(feed)) {
            continue;
        }
        if (replaced && elsewhere && feed->is_bound()) {
            detach(*feed);
            feed->on_lost("another run of " + std::string{node} + " has its name", now);
        }
        feed->hurry(now);
    }
}

std::vector<core::feed_machine*> feed_links::in_order() const {
    std::vector<core::feed_machine*> feeds;
    feeds.reserve(feeds_.size());
    for (const auto& [feed, e] : feeds_) {
        feeds.push_back(feed);
    }
    std::sort(feeds.begin(), feeds.end(),
              [this](auto* a, auto* b) { return feeds_.at(a).number < feeds_.at(b).number; });
    return feeds;
}

void feed_links::stop() {
    const auto feeds = feeds_;
    for (auto* feed : in_order()) {
        if (const auto handle = feeds.at(feed).handle.lock()) {
            // Taken out of the feed, which they may own: else neither would go if the context goes without running.
            feed->abandon().fail(host_.completions(), errc::stopped);
        }
    }
}

} // namespace cles::shell
