// SPDX-License-Identifier: BSL-1.0
#include "core/routing.hpp"

#include "core/all_binding.hpp"
#include "core/any_request.hpp"
#include "core/forwarding.hpp"
#include "core/gathering.hpp"

#include <chrono>
#include <utility>

namespace cles::core {

routing::routing(std::shared_ptr<node> host, onward& out, std::uint32_t seed, std::function<void()> wake)
    : node_(std::move(host)), out_(out), catalogue_(*node_, out, *this), chooser_(*node_, catalogue_, seed),
      relays_(std::make_shared<relays>(*node_, out, wake)), wake_(std::move(wake)) {
    node_->way = this;
}

routing::~routing() { stop(); }

void routing::stop() {
    if (!std::exchange(stopped_, true)) {
        node_->way = nullptr;
        catalogue_.stop();
        relays_->stop();
        waiting_.clear();
        ready_.clear();
    }
}

bool routing::route(const protocol::request_line& r, const identity& peer, time_point due, time_point now,
                    call_opener& from) {
    const auto target = r.noun.target;
    if (target == "any" && !held_) {
        const auto chosen = chooser_.choose(r, {}, now);
        if (chosen.here && runs_in_line(r)) {
            return false;
        }
        if (!chosen.nobody()) {
            if (auto c = from.open_call(r, due, now)) {
                std::make_shared<any_request>(shared_from_this(), r, peer, std::move(c), due)->ask(chosen, now);
            }
            return true;
        }
    }
    auto c = from.open_call(r, due, now);
    if (!c) {
        return true;
    }
    if (target == "any") {
        begin(std::make_shared<any_request>(shared_from_this(), r, peer, std::move(c), due), now);
    } else if (target == "all") {
        begin(std::make_shared<gathering>(shared_from_this(), r, peer, std::move(c), due), now);
    } else if (r.hops == 0) {
        c->fail({.code = errc::no_target,
                 .message = "it may not be passed on to '" + std::string{target} + "': it bears hops=0"});
    } else {
        std::make_shared<forwarding>(std::move(c), std::string{target})->go(out_, r, node_->name, due);
    }
    return true;
}

void routing::go_on(const protocol::request_line& r, const identity& peer, const protocol::failure& why, time_point due,
                    time_point now, call_opener& from) {
    if (auto c = from.open_call(r, due, now)) {
        std::make_shared<any_request>(shared_from_this(), r, peer, std::move(c), due)->go_on_from_here(why);
    }
}

void routing::bind(const protocol::request_line& r, relayed_bindings& place, time_point due, time_point now,
                   call_opener& from) {
    const auto c = from.open_call(r, due, now);
    if (!c) {
        return;
    }
    const binding::terms wanted{.every = std::chrono::milliseconds{r.every_ms}, .keep = r.keep};
    std::string scratch;
    const std::string path{protocol::canonical_path(r.noun, scratch)};
    if (r.noun.target == "all") {
        const auto all = std::make_shared<all_binding>(shared_from_this(), r, path, place, wanted, c, due);
        const auto before = place.bind_all(path, all);
        std::erase_if(all_, [](const auto& gone) { return gone.expired(); });
        all_.push_back(all);
        begin(all, now);
        if (before) {
            before->close(all.get());
        }
    } else if (r.noun.target == "any" || r.hops == 0) {
        c->fail({.code = errc::no_target,
                 .message = r.hops == 0 ? "it may not be passed on: it bears hops=0"
                                        : "a binding is of a node's noun, or of that of all"});
    } else {
        place.bind(r.noun.target, path, onward_adverbs(r, node_->name), wanted, r.wants_mark, c);
    }
}

// A handler that answers at once needs no call.
bool routing::runs_in_line(const protocol::request_line& r) const {
    if (r.noun.task == "cles") {
        return true;
    }
    const auto* h = node_->tasks.find(r.verb, r.noun.task);
    return h != nullptr && h->plain;
}

void routing::begin(std::shared_ptr<errand> e, time_point now) {
    while (!waiting_.empty() && waiting_.front()->over()) {
        waiting_.pop_front();
    }
    if (!e->begin(now)) {
        waiting_.push_back(std::move(e));
    }
}

void routing::release(time_point now) {
    held_ = false;
    on_offers(now);
}

void routing::begin_soon(std::shared_ptr<errand> e) {
    if (!stopped_) {
        ready_.push_back(std::move(e));
        wake_();
    }
}

// What a handler makes ready has another turn; it may stop this as well.
void routing::begin_ready(time_point now) {
    for (auto left = ready_.size(); left != 0 && !ready_.empty(); --left) {
        auto next = std::move(ready_.front());
        ready_.pop_front();
        if (!ready_.empty()) {
            wake_(); // before user code is called, which may throw
        }
        if (!next->over()) {
            begin(std::move(next), now);
        }
    }
}

// Each in its order; those for which nothing has changed go on waiting.
void routing::on_offers(time_point) {
    for (auto all = std::exchange(waiting_, {}); !all.empty(); all.pop_front()) {
        if (!all.front()->over()) {
            begin_soon(std::move(all.front()));
        }
    }
    for (const auto& weak : std::vector<std::weak_ptr<all_binding>>{all_}) {
        if (const auto all = weak.lock(); all && !stopped_) {
            all->follow();
        }
    }
}

protocol::failure routing::nobody_offers(const protocol::request_line& r) const {
    return {.code = errc::no_target,
            .message = "nobody that is known offers " + std::string{to_string(r.verb)} + " '" +
                       std::string{r.noun.task} + "'"};
}

} // namespace cles::core
