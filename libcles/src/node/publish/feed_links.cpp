// SPDX-License-Identifier: BSL-1.0
#include "node/publish/feed_links.hpp"

#include "node/base/deadlines.hpp"
#include "node/local_node.hpp"
#include "node/routing/peer_channels.hpp"
#include "node/security_protocol.hpp"
#include "node/session/outbound.hpp"
#include "node/session/request_checks.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace cles::core {
namespace {

// As long as its user waits for a BIND that is sent now.
time_point whole_time(const feed_entry& e, time_point now) {
    return saturating_add(now, time_limit(e.terms.deadline, verb::bind));
}
// What is left of the time of a BIND that had to learn something first, if it has not passed.
time_point due_of(const feed_entry& e, time_point now) { return e.due && *e.due > now ? *e.due : whole_time(e, now); }

} // namespace

/// The reply to a request for a feed, which lives as long as its handle.
class feed_links::feed_reply final : public detail::pending {
  public:
    feed_reply(std::weak_ptr<local_node> host, std::weak_ptr<void> handle, reply_function then)
        : host_(std::move(host)), handle_(std::move(handle)), then_(std::move(then)) {}

    verdict offer(std::string_view json) override { return take(json, {}); }
    verdict offer_marked(std::string_view json, const update_mark& mark) override { return take(json, mark); }
    void fail(boost::system::error_code code, std::string_view message) override { refuse(code, message, {}); }
    void refuse(boost::system::error_code code, std::string_view message, std::string_view answer) override {
        const std::string text{message};
        const std::string whole{answer};
        finish({.code = code, .text = text, .answer = whole});
    }
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

  private:
    verdict take(std::string_view json, const std::optional<update_mark>& mark) {
        if (!detail::is_valid_answer(json)) {
            return verdict::malformed;
        }
        finish({.text = json, .mark = mark});
        return verdict::completed;
    }
    void finish(const reply& received) {
        const std::unique_ptr<feed_reply> self{this};
        const auto host = host_.lock();
        const auto alive = handle_.lock();
        then_(alive ? host.get() : nullptr, received);
    }

    std::weak_ptr<local_node> host_;
    std::weak_ptr<void> handle_;
    reply_function then_;
};

detail::pending_ptr feed_links::on_reply(const feed_machine& feed, reply_function then) {
    return detail::pending_ptr{new feed_reply(host_.weak_from_this(), feed.entry().handle, std::move(then))};
}

// `self` is whoever is there, and `all` has many publishers.
bool feed_links::is_passed_on(const feed_machine& feed, const connection& c) const {
    return host_.node().secured && c.peer().transport != "inproc" && c.peer().name != feed.target() &&
           !protocol::is_reserved_target(member_of(host_.node(), feed.target()));
}

// The value in a reply is not signed. So if updates must be, or that is not known, only the publisher's own reply
// counts.
bool feed_links::is_value_trusted(feed_machine& feed) const {
    const auto c = feed.entry().on.lock();
    if (!c || !is_passed_on(feed, *c)) {
        return true;
    }
    const auto task = std::string_view{feed.path()}.substr(0, feed.path().find('/'));
    return !host_.node().secured->must_be_signed(feed.target(), task).value_or(true);
}

void feed_links::on_bind_reply(feed_machine& feed, const reply& received, std::optional<time_point> asked,
                               marking marks) {
    auto last = received.text;
    if (received.code) {
        if (feed.closed()) {
            return;
        }
        if (!feed.is_bound_without_value(received.code)) {
            // It may be bound nevertheless, and would receive updates for ever: because the publisher answers late, or
            // because those that shared its binding have left it to this one.
            if (received.code == errc::deadline || feed.has_shared()) {
                unbind(feed);
            } else {
                detach(feed);
            }
            feed.on_refused(received.code, received.text, host_.now(), received.answer);
            return;
        }
        last = "{}";
    }
    auto mark = received.mark;
    if (!is_value_trusted(feed)) {
        last = "{}";
        mark.reset();
    }
    if (mark && marks == marking::up_to_it) {
        feed.skip_to(*mark);
    }
    const bool shown = feed.entry().terms.shows_mark;
    feed.on_bound(last, marks == marking::as_update ? mark : std::nullopt, mark && shown ? *mark : update_mark{});
    if (asked) {
        feed.on_leased(*asked);
    }
}

void feed_links::enter(feed_machine& feed, std::weak_ptr<void> handle, feed_terms terms) {
    feed.set_sharing_key("every=" + std::to_string(terms.every_ms) + " keep=" + std::to_string(terms.keep) +
                         " hops=" + std::to_string(terms.hops) + " " + terms.adverbs);
    feed.entry().handle = std::move(handle);
    feed.entry().terms = std::move(terms);
    feeds_.push_back(feed);
}

void feed_links::refuse_later(feed_machine& feed, boost::system::error_code code, const std::string& why) {
    post(host_.environment(), [host = host_.shared_from_this(), handle = feed.entry().handle.lock(), &feed, code, why] {
        feed.on_refused(code, why, host->now());
    });
}

// Feeds for clients have adverbs, with the client, whose rights have been checked.
bool feed_links::is_permitted(feed_machine& feed) const {
    return !feed.entry().terms.adverbs.empty() || protocol::is_reserved_target(feed.target()) ||
           permits(host_.node(), {.requester = host_.node().name}, feed.target(), verb::bind, feed.path());
}

void feed_links::bind(feed_machine& feed) {
    if (host_.stopped()) {
        refuse_later(feed, errc::stopped, "the service has been stopped");
        return;
    }
    if (!is_permitted(feed)) {
        refuse_later(feed, errc::denied, host_.node().name + " may not bind '" + feed.path() + "' of " + feed.target());
        return;
    }
    auto& e = feed.entry();
    boost::system::error_code code;
    std::string why;
    auto* r = host_.peer_channels().to({.target = feed.target(),
                                        .at = e.terms.at,
                                        .expected = e.terms.at_node,
                                        .by = {.via = e.terms.via, .requester = e.terms.requester}},
                                       code, why);
    if (r == nullptr) {
        refuse_later(feed, code, why);
        return;
    }
    e.at = r->address();
    r->connect(feed,
               [host = host_.shared_from_this(), handle = e.handle.lock(), &feed](
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
}

// For an existing binding, the publisher may have queued updates that are older than the value in its reply. (A reply
// for `all` comes from several publishers, and has the mark of each value in its body.)
feed_links::marking feed_links::marking_of(feed_machine& feed, connection& c) {
    const bool joins = !feed.was_bound() && feed.target() != "all" && c.session().bound().has_bound_for(feed);
    const auto& terms = feed.entry().terms;
    return terms.marked ? marking::as_update : joins || terms.shows_mark ? marking::up_to_it : marking::none;
}

void feed_links::send_bind(feed_machine& feed, const std::shared_ptr<connection>& c) {
    // A node is asked before the first BIND, also for what it reads; anything else only if that is needed.
    if (c->description() == nullptr && (marking_of(feed, *c) != marking::none || (!c->is_datagram() && c->is_node()))) {
        ask_for_description(feed, c);
        return;
    }
    // What a node of another pool has published counts from its first update on (docs/federation.md, "Security").
    if (is_passed_on(feed, *c) && c->peer().transport != "pool" && host_.node().peers.owner(feed.target()) == nullptr) {
        ask_publisher(feed, c);
        return;
    }
    bind_on(feed, c);
}

void feed_links::bind_on(feed_machine& feed, const std::shared_ptr<connection>& c) {
    auto& e = feed.entry();
    auto marks = marking_of(feed, *c);
    const auto* const publisher = c->description();
    if (marks != marking::none && (publisher == nullptr || !publisher->marks)) {
        marks = marking::none;
    }
    e.on = c;
    const auto now = host_.now();
    const auto asked = c->is_datagram() ? std::optional{now} : std::nullopt;
    auto request = bind_request(feed, *c);
    request.wants_mark = marks != marking::none;
    const auto due = due_of(e, now);
    e.due.reset();
    c->bind(feed, request, due, on_reply(feed, [&feed, asked, marks](local_node* host, const reply& received) {
                if (host != nullptr) {
                    host->feeds().on_bind_reply(feed, received, asked, marks);
                }
            }));
}

void feed_links::ask_for_description(feed_machine& feed, const std::shared_ptr<connection>& c) {
    feed.entry().due = whole_time(feed.entry(), host_.now());
    c->await_description(
        [weak = host_.weak_from_this(), handle = feed.entry().handle, &feed](const peer_answer& found) {
            const auto host = weak.lock();
            const auto alive = handle.lock();
            if (!host || !alive || feed.closed()) {
                return;
            }
            if (found.code == errc::unavailable || found.code == errc::busy) {
                feed.on_refused(found.code, std::string{found.message}, host->now());
            } else {
                host->feeds().bind(feed);
            }
        });
}

// Without its announcement, only the publisher can tell in which epoch it runs, and what it signs: then its updates and
// the value in the reply count from the beginning. If it does not tell, none of them would count, so that is an error.
void feed_links::ask_publisher(feed_machine& feed, const std::shared_ptr<connection>& c) {
    auto& e = feed.entry();
    e.due = due_of(e, host_.now());
    c->session().ask_publisher(
        feed.target(), *e.due,
        [weak = host_.weak_from_this(), handle = e.handle, &feed, asked = std::weak_ptr{c}](const peer_answer& found) {
            const auto host = weak.lock();
            const auto alive = handle.lock();
            if (!host || !alive || feed.closed()) {
                return;
            }
            const auto there = asked.lock();
            if (found.code) {
                feed.entry().due.reset(); // the next attempt has a time of its own
                feed.on_refused(found.code, std::string{found.message}, host->now(), std::string{found.refusal});
            } else if (there && there->usable()) {
                host->feeds().bind_on(feed, there);
            } else {
                host->feeds().bind(feed);
            }
        });
}

protocol::outgoing_request feed_links::bind_request(feed_machine& feed, const connection& c) {
    auto& e = feed.entry();
    protocol::outgoing_request request{.verb = verb::bind,
                                       .noun = e.terms.noun,
                                       .id = host_.draw_id(),
                                       .every_ms = e.terms.every_ms,
                                       .keep = e.terms.keep,
                                       .hops = e.terms.hops,
                                       .adverbs = e.terms.adverbs};
    if (c.is_datagram()) {
        request.lease_ms = static_cast<std::uint32_t>(host_.bounds().lease.count());
        e.asking = request.id;
    }
    return request;
}

void feed_links::renew(feed_machine& feed, time_point until) {
    if (const auto c = feed.entry().on.lock()) { // otherwise its loss has been reported
        const auto now = host_.now();
        const auto request = bind_request(feed, *c);
        c->session().asking().send(
            request, until, now, on_reply(feed, [&feed, now](local_node* host, const reply& received) {
                if (host == nullptr) {
                    return;
                }
                if (received.code) {
                    feed.on_renewal_refused(now, received.code, std::string{received.text}, host->now());
                } else {
                    feed.on_renewed(now);
                }
            }));
    }
}

void feed_links::detach(feed_machine& feed) {
    auto& e = feed.entry();
    if (const auto c = std::exchange(e.on, {}).lock()) {
        c->unbind(feed);
        if (const auto asking = std::exchange(e.asking, 0)) {
            c->session().asking().drop(asking); // a retransmission would bind again
        }
    }
}

void feed_links::unbind(feed_machine& feed) {
    host_.peer_channels().forget(feed);
    const auto c = feed.entry().on.lock();
    const auto now = host_.now();
    detach(feed);
    // Another feed may share the binding.
    if (c && c->usable() && !host_.stopped() && !c->session().bound().has(feed.target(), feed.path())) {
        const auto& terms = feed.entry().terms;
        const auto whose = terms.requester.empty() ? std::string{} : protocol::adverb_from(terms.requester);
        c->session().asking().send(
            {.verb = verb::bind, .noun = terms.noun, .id = host_.draw_id(), .lease_ms = 0, .adverbs = whose},
            saturating_add(now, time_limit({}, verb::bind)), now, detail::pending_ptr{new discarded_reply});
    }
}

template <class Condition, class Action>
void feed_links::for_each(Condition concerns, Action act) {
    std::vector<std::pair<feed_machine*, std::weak_ptr<void>>> found;
    for (auto& feed : feeds_) {
        if (concerns(feed)) {
            found.emplace_back(&feed, feed.entry().handle);
        }
    }
    for (const auto& [feed, handle] : found) {
        if (const auto alive = handle.lock(); alive && feed->is_linked() && concerns(*feed)) {
            act(*feed);
        }
    }
}

void feed_links::on_new_incarnation(std::string_view node, bool replaced) {
    const std::string where{host_.node().peers.address_of(node).value_or(std::string_view{})};
    const auto now = host_.now();
    for_each([&](const feed_machine& feed) { return feed.target() == node && feed.entry().terms.at.empty(); },
             [&](feed_machine& feed) {
                 if (replaced && feed.is_bound() && feed.entry().at != where) {
                     detach(feed);
                     feed.on_lost(std::string{node} + " was replaced by another instance", now);
                 }
                 feed.expedite(now);
             });
}

void feed_links::unbind_where(const std::function<bool(feed_machine&)>& concerns, const std::string& why,
                              bool bind_at_once) {
    for_each([&](feed_machine& feed) { return feed.is_bound() && concerns(feed); },
             [&](feed_machine& feed) {
                 unbind(feed);
                 feed.on_lost(why, host_.now());
                 if (bind_at_once) {
                     feed.expedite(host_.now());
                 }
             });
}

void feed_links::on_route_lost(std::string_view node, std::string_view address) {
    const auto concerns = [&](feed_machine& feed) {
        const auto& e = feed.entry();
        return feed.target() == node && e.terms.at.empty() && e.at == address;
    };
    unbind_where(concerns, "the route to " + std::string{node} + " has changed", true);
}

void feed_links::on_security_changed() {
    unbind_where([this](feed_machine& feed) { return !is_permitted(feed); },
                 host_.node().name + " may no longer bind it", false);
}

void feed_links::stop() {
    for_each([](const feed_machine&) { return true; }, [](feed_machine& feed) { feed.close(errc::stopped); });
}

} // namespace cles::core
