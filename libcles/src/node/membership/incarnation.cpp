// SPDX-License-Identifier: BSL-1.0
#include "node/membership/incarnation.hpp"

#include "node/membership/reachable_endpoints.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

incarnation incarnation::first(const sighting& w, std::uint64_t& numbers) {
    incarnation r;
    r.epoch = w.epoch;
    r.last_seen = w.announced_at;
    r.apply(w, numbers);
    r.described_revision = r.revision;
    r.service_us = w.announced.load.service_us;
    return r;
}

// Gossip arrives by several paths, and nodes on each may have omitted endpoints. For one incarnation, only a longer
// list replaces a shorter one; otherwise changes would circulate forever. Signed announcements arrive unchanged: the
// list of the newest one counts.
//
// An incarnation received by several interfaces keeps the endpoints of the first one; otherwise each announcement would
// move it.
bool incarnation::apply_endpoints(const sighting& w) {
    const bool in_group = from != group_source{};
    const bool by_another = !w.is_from_gossip() && in_group && from != w.from;
    if ((w.is_from_gossip() && in_group && !is_lost_in_group(w)) || (by_another && !is_better_endpoint_source(w)) ||
        (!w.is_from_gossip() && from == w.from && announced.endpoints == w.announced.endpoints)) {
        return false;
    }
    auto usable = reachable_endpoints(w.announced.endpoints, w.by);
    auto for_others = endpoints_to_relay(w.announced.endpoints, w.by);
    const bool others_announced = w.is_signed() && announced.endpoints != w.announced.endpoints;
    if (w.is_from_gossip() && !others_announced && usable.size() <= endpoints.size() &&
        for_others.size() <= relayed_endpoints.size()) {
        return false;
    }
    if (by_another && usable.empty()) {
        return false;
    }
    if (!w.is_from_gossip()) {
        from = w.from;
    }
    endpoints = std::move(usable);
    relayed_endpoints = std::move(for_others);
    announced.endpoints = w.announced.endpoints;
    return true;
}

// A source on loopback is on this host, so that its Unix sockets and loopback addresses can be used too. One that the
// node itself no longer states is not used any more.
bool incarnation::is_better_endpoint_source(const sighting& w) const noexcept {
    return endpoints.empty() || (w.from.is_loopback() && !from.is_loopback()) ||
           (w.is_signed() && std::ranges::find(w.announced.sources, from) == w.announced.sources.end()) ||
           w.announced_at - last_seen_at_source >= announced.interval * 7 / 2;
}

// A signed announcement shows where the node is as well as one that was received in the group.
bool incarnation::is_lost_in_group(const sighting& w) const noexcept {
    return w.is_signed() && w.announced_at - last_seen_at_source >= announced.interval * 7 / 2;
}

bool incarnation::on_repeat(const sighting& w) {
    if (w.is_from_gossip()) { // another path may provide an address
        return endpoints.empty() && (!w.is_signed() || w.seq == seq) && apply_endpoints(w);
    }
    if (w.seq != seq) { // outdated
        return false;
    }
    // From the source in use, an announcement counts if a copy from elsewhere was taken before it; otherwise it is a
    // repeat.
    const bool moved = (w.from != from || last_seen_at_source < last_seen) && apply_endpoints(w);
    if (w.from == from) {
        last_seen_at_source = std::max(last_seen_at_source, w.announced_at);
    }
    if (w.is_signed()) { // it may be known by gossip, which states none
        announced.sources = w.announced.sources;
    }
    return moved;
}

// A new service time is reported only if it makes a difference for load balancing.
bool incarnation::is_significant_load_change(const node_load& now) const noexcept {
    constexpr std::uint32_t min_reported = 50'000; // microseconds
    const auto [less, more] = std::minmax(service_us, now.service_us);
    return announced.load.workers != now.workers || (more >= min_reported && more / 4 > less);
}

void incarnation::apply(const sighting& w, std::uint64_t& numbers) {
    const bool placed = apply_endpoints(w);
    const bool describes = w.describes();
    if (placed || is_significant_load_change(w.announced.load) || announced.roster != w.announced.roster ||
        (describes && (announced.tasks != w.announced.tasks || announced.signed_tasks != w.announced.signed_tasks ||
                       announced.links != w.announced.links))) {
        described_revision = ++numbers;
        service_us = w.announced.load.service_us;
    }
    announced.node = w.announced.node;
    announced.pool = w.announced.pool;
    announced.roster = w.announced.roster;
    announced.original = w.announced.original;
    announced.load = w.announced.load;
    announced.interval = w.announced.interval;
    if (describes) {
        announced.tasks = w.announced.tasks;
        announced.signed_tasks = w.announced.signed_tasks;
        announced.links = w.announced.links;
    }
    if (!w.is_from_gossip()) {
        announced.sources = w.announced.sources;
    }
    if (w.from == from) {
        last_seen_at_source = w.announced_at;
    }
    seq = std::max(seq, w.seq);
    last_seen = std::max(last_seen, w.announced_at);
    revision = ++numbers;
}

void tombstones::add(std::uint32_t epoch, entry ended, time_point now) {
    if (max_entries_ == 0) {
        return;
    }
    if (entries_.size() >= max_entries_) {
        std::erase_if(entries_, [now](const auto& each) { return each.second.until <= now; });
    }
    if (entries_.size() >= max_entries_ && !entries_.contains(epoch)) {
        entries_.erase(std::min_element(entries_.begin(), entries_.end(),
                                        [](const auto& a, const auto& b) { return a.second.until < b.second.until; }));
    }
    entries_.insert_or_assign(epoch, std::move(ended));
}

} // namespace cles::core
