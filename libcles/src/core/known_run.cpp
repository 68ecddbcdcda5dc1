// SPDX-License-Identifier: BSL-1.0
#include "core/known_run.hpp"

#include "core/reachable.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
known_run known_run::first(const word& w, std::uint64_t& numbers) {
    known_run r;
    r.epoch = w.epoch;
    r.heard = w.spoken;
    r.take(w, numbers);
    r.described = r.news;
    r.service_us = w.said.load.service_us;
    return r;
}

// What is told comes by many ways, on each of which something may have been left out: of the same run only more is
// better, or news of it would go round for ever.
//
// A run that is heard by several interfaces goes on being asked by the one that it was heard by first, or each
// announcement would move it.
bool known_run::place(const word& w) {
    const bool in_group = from != group_source{};
    const bool by_another = !w.told() && in_group && from != w.from;
    if ((w.told() && in_group) || (by_another && !is_asked_better_by(w)) ||
        (!w.told() && from == w.from && said.endpoints == w.said.endpoints)) {
        return false;
    }
    auto usable = reachable_endpoints(w.said.endpoints, w.by);
    auto for_others = endpoints_to_pass_on(w.said.endpoints, w.by);
    if (w.told() && usable.size() <= endpoints.size() && for_others.size() <= passed_on.size()) {
        return false;
    }
    if (by_another && usable.empty()) {
        return false;
    }
    if (!w.told()) {
        from = w.from;
    }
    endpoints = std::move(usable);
    passed_on = std::move(for_others);
    said.endpoints = w.said.endpoints;
    return true;
}

// By loopback it is on this host, where Unix sockets and what listens on loopback alone can be asked too.
bool known_run::is_asked_better_by(const word& w) const noexcept {
    return endpoints.empty() || (w.from.is_loopback() && !from.is_loopback()) ||
           w.spoken - heard_there >= said.interval * 7 / 2;
}

bool known_run::hear_again(const word& w) {
    if (w.told()) {
        return endpoints.empty() && place(w); // another way leads to it
    }
    if (w.seq != seq) { // overtaken
        return false;
    }
    // From where it is asked, what it says counts if a copy from elsewhere was taken before it; else it is a repeat.
    const bool moved = (w.from != from || heard_there < heard) && place(w);
    if (w.from == from) {
        heard_there = std::max(heard_there, w.spoken);
    }
    return moved;
}

// Of the time that work takes, only what makes a node another choice is worth telling anew.
bool known_run::is_another_choice(const node_load& now) const noexcept {
    constexpr std::uint32_t worth_telling = 50'000; // microseconds
    const auto [less, more] = std::minmax(service_us, now.service_us);
    return said.load.workers != now.workers || (more >= worth_telling && more / 4 > less);
}

void known_run::take(const word& w, std::uint64_t& numbers) {
    const bool placed = place(w);
    const bool describes = w.seq != 0 || !w.said.tasks.empty();
    if (placed || is_another_choice(w.said.load) || (describes && said.tasks != w.said.tasks)) {
        described = ++numbers;
        service_us = w.said.load.service_us;
    }
    said.node = w.said.node;
    said.pool = w.said.pool;
    said.load = w.said.load;
    said.interval = w.said.interval;
    if (describes) {
        said.tasks = w.said.tasks;
    }
    if (!w.told()) {
        said.sources = w.said.sources;
    }
    if (w.from == from) {
        heard_there = w.spoken;
    }
    seq = std::max(seq, w.seq);
    heard = std::max(heard, w.spoken);
    news = ++numbers;
}

} // namespace cles::core
