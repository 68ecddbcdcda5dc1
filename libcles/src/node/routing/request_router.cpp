// SPDX-License-Identifier: BSL-1.0
#include "node/routing/request_router.hpp"

#include "node/membership/gossip.hpp"
#include "node/routing/all_binding.hpp"
#include "node/routing/deferred_request.hpp"
#include "node/session/inbound.hpp"
#include "node/session/request_checks.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <utility>

namespace cles::core {

request_router::request_router(std::shared_ptr<node_state> host, next_hop& out, std::uint32_t seed,
                               std::function<void()> wake)
    : node_(std::move(host)), out_(out), service_registry_(*node_, out, [this] { on_offers(); }),
      load_balancer_(*node_, service_registry_, seed), relays_(std::make_shared<relays>(*node_, out)),
      wake_(std::move(wake)) {
    node_->active_router = this;
}

request_router::~request_router() { stop(); }

void request_router::stop() {
    if (!std::exchange(stopped_, true)) {
        node_->active_router = nullptr;
        service_registry_.stop();
        relays_->stop();
        waiting_.clear();
        ready_.clear();
    }
}

bool request_router::route(const protocol::request_line& r, const identity& peer, time_point due, time_point now,
                           inbound& from) {
    const auto target = r.noun.target;
    const auto by = origin_of(*node_, peer, r);
    if (target == "any" && !waits_for_discovery_) {
        const auto chosen = load_balancer_.choose(r, by, {}, now);
        if (chosen.here && runs_in_line(r)) {
            return false;
        }
        if (!chosen.nobody()) {
            if (auto c = from.make_call(r, due, now)) {
                std::make_shared<any_request>(shared_from_this(), r, peer, std::move(c), due)->ask(chosen, now);
            }
            return true;
        }
    }
    auto c = from.make_call(r, due, now);
    if (!c) {
        return true;
    }
    if (target == "any") {
        begin(std::make_shared<any_request>(shared_from_this(), r, peer, std::move(c), due), now);
    } else if (target == "all") {
        begin(std::make_shared<scatter_gather>(shared_from_this(), r, peer, std::move(c), due), now);
    } else if (r.hops == 0) {
        c->fail(no_hops_left(r));
    } else {
        forward(r, by, std::move(c), due);
    }
    return true;
}

// Reply, progress and cancellation are forwarded too.
void request_router::forward(const protocol::request_line& r, const request_origin& by, std::shared_ptr<call> c,
                             time_point due) {
    const auto ticket = send(
        r, by, r.noun.target, due,
        [c, node = std::string{r.noun.target}](std::string_view json, subrequest_failure* why) {
            if (why == nullptr) {
                c->done(json);
            } else {
                c->fail(named(std::move(*why), node));
            }
        },
        progress_to(c));
    c->on_stop([self = shared_from_this(), ticket] { self->out_.cancel(ticket); });
}

std::uint64_t request_router::send(const protocol::request_line& r, const request_origin& by, std::string_view node,
                                   time_point due, subrequest_outcome then, outbound::progress_function progress) {
    subrequest_failure why{.reported = {}, .may_have_started = false};
    const auto permit = forwarding_permit::ask(*node_, r, by, node, why.reported);
    if (!permit) {
        then({}, &why);
        return 0;
    }
    const auto noun = std::string{node}.append(":").append(r.noun.path);
    return out_.forward(
        *permit, {.verb = r.verb, .noun = noun, .carried = r.carried(), .adverbs = permit->adverbs(), .body = r.body},
        due, detail::pending_ptr{new subrequest(std::move(then))}, std::move(progress));
}

void request_router::cancel(const attempt& part) {
    if (part.here) {
        part.here->withdraw();
    } else if (part.ticket != 0 && !stopped_) {
        out_.cancel(part.ticket);
    }
}

void request_router::continue_after_busy(const protocol::request_line& r, const identity& peer,
                                         const protocol::failure& why, time_point due, time_point now, inbound& from) {
    if (auto c = from.make_call(r, due, now)) {
        std::make_shared<any_request>(shared_from_this(), r, peer, std::move(c), due)
            ->continue_after_local_refusal(why);
    }
}

void request_router::bind(const protocol::request_line& r, const request_origin& by, relayed_bindings& place,
                          time_point due, time_point now, inbound& from) {
    const auto c = from.make_call(r, due, now);
    if (!c) {
        return;
    }
    const binding::terms wanted{.every = std::chrono::milliseconds{r.every_ms}, .keep = r.keep};
    std::string scratch;
    const relayed_path path{std::string{protocol::canonical_path(r.noun, scratch)}, by};
    if (r.noun.target == "all") {
        const auto all = std::make_shared<all_binding>(shared_from_this(), r, path, place, wanted, c, due);
        const auto before = place.bind_all(path, all);
        std::erase_if(all_, [](const auto& gone) { return gone.expired(); });
        all_.push_back(all);
        begin(all, now);
        if (before) {
            before->close(all.get());
        }
    } else if (r.noun.target == "any") {
        c->fail({.code = errc::no_target, .message = "a binding needs a node's name or 'all'"});
    } else if (r.hops == 0) {
        c->fail(no_hops_left(r));
    } else {
        protocol::failure why;
        if (const auto permit = forwarding_permit::ask(*node_, r, by, r.noun.target, why)) {
            place.bind(*permit, path, wanted, r.wants_mark, c);
        } else {
            c->fail(why);
        }
    }
}

// A handler that replies at once needs no call.
bool request_router::runs_in_line(const protocol::request_line& r) const {
    if (r.noun.task == "cles") {
        return true;
    }
    const auto* h = node_->tasks.find(r.verb, r.noun.task);
    return h != nullptr && h->plain;
}

void request_router::begin(std::shared_ptr<deferred_request> e, time_point now) {
    while (!waiting_.empty() && waiting_.front()->over()) {
        waiting_.pop_front();
    }
    if (!e->begin(now)) {
        waiting_.push_back(std::move(e));
    }
}

void request_router::release(bool expects_nodes) {
    waits_for_discovery_ = false;
    expects_nodes_ = expects_nodes;
    on_offers();
}

void request_router::schedule(std::shared_ptr<deferred_request> e) {
    if (!stopped_) {
        ready_.push_back(std::move(e));
        wake_();
    }
}

// What a handler makes ready waits for another turn. A handler may also stop this.
void request_router::begin_ready(time_point now) {
    for (auto left = ready_.size(); left != 0 && !ready_.empty(); --left) {
        auto next = std::move(ready_.front());
        ready_.pop_front();
        if (!ready_.empty()) {
            wake_(); // before user code, which may throw
        }
        if (!next->over()) {
            begin(std::move(next), now);
        }
    }
}

// In their order; those for which nothing has changed wait again.
void request_router::on_offers() {
    for (auto all = std::exchange(waiting_, {}); !all.empty(); all.pop_front()) {
        if (!all.front()->over()) {
            schedule(std::move(all.front()));
        }
    }
    for (const auto& weak : std::vector<std::weak_ptr<all_binding>>{all_}) {
        if (const auto all = weak.lock(); all && !stopped_) {
            all->follow();
        }
    }
}

protocol::failure request_router::no_hops_left(const protocol::request_line& r) const {
    const auto named = r.via.empty() ? 0 : std::ranges::count(r.via, ',') + 1;
    const auto forwarded = named - (is_in_via(r.via, "all") ? 1 : 0); // of a part for all nodes
    const auto most = static_cast<std::int64_t>(protocol::max_hops);
    auto advice = "state a greater one, at most " + std::to_string(most);
    if (auto* const routes = node_->gossip_responder) {
        if (const auto left = routes->reach().hops_to(r.noun.target)) {
            const auto needed = forwarded + static_cast<std::int64_t>(*left);
            advice = needed > most ? "no request may be forwarded more than " + std::to_string(most) + " times"
                                   : "state hops=" + std::to_string(needed) + " (at most " + std::to_string(most) + ")";
        }
    }
    return {.code = errc::no_target,
            .message = "the request for '" + std::string{r.noun.target} + "' has been forwarded " +
                       std::to_string(forwarded) + " times, and hops=" + std::to_string(forwarded) +
                       " permits no more: " + advice};
}

protocol::failure request_router::no_provider(const protocol::request_line& r) const {
    return {.code = errc::no_target,
            .message =
                "no known node offers " + std::string{to_string(r.verb)} + " '" + std::string{r.noun.task} + "'"};
}

} // namespace cles::core
