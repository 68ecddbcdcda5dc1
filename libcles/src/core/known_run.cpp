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
bool known_run::place(const word& w) {
    if (w.told() ? from != group_source{} : said.endpoints == w.said.endpoints && from == w.from) {
        return false;
    }
    auto usable = reachable_endpoints(w.said.endpoints, w.by);
    auto for_others = endpoints_to_pass_on(w.said.endpoints, w.by);
    if (w.told() && usable.size() <= endpoints.size() && for_others.size() <= passed_on.size()) {
        return false;
    }
    endpoints = std::move(usable);
    passed_on = std::move(for_others);
    said.endpoints = w.said.endpoints;
    return true;
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
    said.load = w.said.load;
    said.interval = w.said.interval;
    if (describes) {
        said.tasks = w.said.tasks;
    }
    if (!w.told()) {
        from = w.from;
    }
    seq = std::max(seq, w.seq);
    heard = std::max(heard, w.spoken);
    news = ++numbers;
}

} // namespace cles::core
