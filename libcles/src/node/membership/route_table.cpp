// SPDX-License-Identifier: BSL-1.0
#include "node/membership/route_table.hpp"

#include <algorithm>
#include <iterator>
#include <tuple>
#include <utility>

namespace cles::core {

void route_table::destination::note_advertised(std::uint64_t s, unsigned h) noexcept {
    if (s > seq) {
        seq = s;
        hops = h;
    } else if (s == seq) {
        hops = std::min(hops, h);
    }
}

const route_table::destination* route_table::find(std::string_view name) const {
    const auto at = epochs_.find(name);
    return at == epochs_.end() ? nullptr : &destinations_.at(at->second);
}

route_table::destination* route_table::find(std::string_view name, std::uint32_t epoch) {
    const auto at = destinations_.find(epoch);
    return at == destinations_.end() || at->second.name != name ? nullptr : &at->second;
}

route_table::destination& route_table::entry_of(std::string_view name, std::uint32_t epoch) {
    if (auto* const known = find(name, epoch)) {
        return *known;
    }
    forget(name);
    if (const auto same = destinations_.find(epoch); same != destinations_.end()) { // two nodes with one epoch
        forget(std::string{same->second.name});
    }
    epochs_.emplace(name, epoch);
    return destinations_.emplace(epoch, destination{.name = std::string{name}}).first->second;
}

route_table::change route_table::apply(std::string_view name, std::uint32_t epoch, std::string_view neighbour,
                                       route_advert offered, const usable_function& usable) {
    auto* d = find(name, epoch);
    const auto* const known = d != nullptr ? d : find(name);
    if (known == nullptr && size() >= max_destinations_) {
        return {};
    }
    change found;
    if (known != nullptr) {
        found.was_offered = std::ranges::find(known->offers, neighbour, &offer::by) != known->offers.end();
        found.before = copy_of(best(*known, usable));
    }
    d = d != nullptr ? d : &entry_of(name, epoch);
    d->take(neighbour, offered);
    found.after = copy_of(best(*d, usable));
    found.requested = d->requested;
    found.missing = missing_number(*d, usable);
    return found;
}

void route_table::destination::take(std::string_view neighbour, route_advert offered) {
    newest = std::max(newest, offered.seq);
    const auto known = std::ranges::find(offers, neighbour, &offer::by);
    if (!offered.hops || *offered.hops >= max_hops) {
        if (known != offers.end()) {
            offers.erase(known);
        }
    } else if (known != offers.end()) {
        known->seq = offered.seq;
        known->hops = *offered.hops;
    } else if (offers.size() < max_offers) {
        offers.push_back({std::string{neighbour}, offered.seq, *offered.hops});
    } else if (auto& oldest = *std::ranges::min_element(offers, {}, &offer::seq); oldest.seq < offered.seq) {
        oldest = {std::string{neighbour}, offered.seq, *offered.hops};
    }
}

std::vector<std::string> route_table::destinations_by(std::string_view neighbour) const {
    std::vector<std::string> found;
    for (const auto& [name, epoch] : epochs_) {
        const auto& offers = destinations_.at(epoch).offers;
        if (std::ranges::find(offers, neighbour, &offer::by) != offers.end()) {
            found.push_back(name);
        }
    }
    return found;
}

std::vector<std::string> route_table::destinations() const {
    std::vector<std::string> found;
    for (const auto& [name, epoch] : epochs_) {
        found.push_back(name);
    }
    return found;
}

std::vector<std::string> route_table::neighbours_of(std::string_view name) const {
    std::vector<std::string> found;
    if (const auto* const d = find(name)) {
        std::ranges::transform(d->offers, std::back_inserter(found), &offer::by);
    }
    return found;
}

void route_table::forget(std::string_view name) {
    if (const auto at = epochs_.find(name); at != epochs_.end()) {
        destinations_.erase(at->second);
        epochs_.erase(at);
    }
}

// Feasible ones first, then the shortest; among equals the newest, then by name, so that the choice is stable.
const route_table::offer* route_table::best(const destination& d, const usable_function& usable,
                                            const std::function<bool(std::string_view)>& avoid) const {
    const auto rank = [&](const offer& o) {
        return std::tuple{!d.is_feasible(o), o.hops, ~o.seq, std::string_view{o.by}};
    };
    const offer* found = nullptr;
    for (const auto& o : d.offers) {
        if (d.is_current(o) && (found == nullptr || rank(o) < rank(*found)) && !(avoid && avoid(o.by)) &&
            usable(o.by)) {
            found = &o;
        }
    }
    return found;
}

const route_table::route* route_table::find_route(std::string_view name, const usable_function& usable,
                                                  const std::function<bool(std::string_view)>& avoid) const {
    const auto* const d = find(name);
    return d == nullptr ? nullptr : best(*d, usable, avoid);
}

std::uint64_t route_table::missing_number(std::string_view name, const usable_function& usable) const {
    const auto* const d = find(name);
    return d == nullptr ? 0 : missing_number(*d, usable);
}

std::uint64_t route_table::missing_number(const destination& d, const usable_function& usable) const {
    if (d.hops > max_hops) {
        return 0;
    }
    const auto* const chosen = best(d, usable);
    return chosen != nullptr && d.is_feasible(*chosen) ? 0 : d.seq + 1;
}

bool route_table::request(std::string_view name, std::uint32_t epoch, std::uint64_t number) {
    auto& d = entry_of(name, epoch);
    return number > std::exchange(d.requested, std::max(d.requested, number));
}

std::uint64_t route_table::newest(std::string_view name) const {
    const auto* const d = find(name);
    return d == nullptr ? 0 : d->newest;
}

route_advert route_table::advertise(std::string_view name, std::uint32_t epoch, bool direct,
                                    const usable_function& usable, std::string_view to) {
    if (direct) { // no loop is possible, so the newest number counts, no matter which node stated it
        auto& d = entry_of(name, epoch);
        d.note_advertised(d.newest, 1);
        return {d.newest, 1};
    }
    auto* const d = find(name, epoch);
    if (d == nullptr) {
        return {};
    }
    const auto* const chosen = best(*d, usable);
    if (chosen == nullptr || chosen->by == to || !d->is_feasible(*chosen)) { // it would or may come back
        return {.seq = d->newest};
    }
    d->note_advertised(chosen->seq, chosen->hops + 1);
    return {chosen->seq, chosen->hops + 1};
}

} // namespace cles::core
