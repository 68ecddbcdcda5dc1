// SPDX-License-Identifier: BSL-1.0
#include "federation/pool_table.hpp"

#include "protocol/fnv1a.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

namespace cles::bridging {
namespace {

// As for nodes (docs/protocol.md, "Membership").
time_point lost_at(const pool_table::bridge& b) { return b.heard + b.interval * 7 / 2; }

// The names that no bridge states any more; not the last ones.
void drop_unstated(pool_table::pool& p) {
    std::set<std::string_view> stated;
    for (const auto& [instance, b] : p.bridges) {
        if (p.names.contains(b.names)) {
            stated.insert(b.names);
        }
    }
    if (!stated.empty()) {
        std::erase_if(p.names, [&stated](const auto& each) { return !stated.contains(each.first); });
    }
}

std::uint64_t hash_of(std::string_view instance, std::string_view noun) noexcept {
    auto hash = protocol::fnv1a(noun, protocol::fnv1a(instance));
    // The last characters change only the lower bits so far.
    hash ^= hash >> 33U;
    hash *= 0xff51afd7ed558ccdU;
    return hash ^ (hash >> 33U);
}

} // namespace

pool_table::arrival pool_table::on_heartbeat(const bridge_id& from, const heartbeat& said, time_point now) {
    if (bridge_count_ >= max_bridges && !is_live(from)) {
        return arrival::ignored;
    }
    auto found = pools_.find(from.pool);
    if (found == pools_.end()) {
        if (pools_.size() >= max_pools && !make_room()) {
            return arrival::ignored;
        }
        found = pools_.emplace(from.pool, pool{}).first;
    }
    found->second.has_left = false;
    auto& bridges = found->second.bridges;
    const auto known = bridges.find(from.instance);
    const bool fresh = known == bridges.end();
    auto& entry = fresh ? bridges[from.instance] : known->second;
    const auto since = fresh ? now : entry.since;
    const bool knows = found->second.names.contains(said.names);
    auto names = knows ? said.names : entry.names;
    entry = {.node = said.node,
             .interval = said.interval,
             .names = std::move(names),
             .heard = now,
             .since = since,
             .is_closing = said.closing};
    drop_unstated(found->second);
    if (!fresh) {
        return arrival::known;
    }
    ++bridge_count_;
    return lost_.erase(from) != 0 ? arrival::returned : arrival::fresh;
}

// For another pool, by forgetting the one that has been without bridges for longest.
bool pool_table::make_room() {
    auto oldest = pools_.end();
    for (auto at = pools_.begin(); at != pools_.end(); ++at) {
        if (at->second.bridges.empty() &&
            (oldest == pools_.end() || at->second.without_bridges < oldest->second.without_bridges)) {
            oldest = at;
        }
    }
    return oldest != pools_.end() && (pools_.erase(oldest), true);
}

void pool_table::note_leaving(const bridge_id& gone) {
    const auto found = pools_.find(gone.pool);
    if (found != pools_.end() && found->second.bridges.contains(gone.instance)) { // it may say so more than once
        found->second.has_left = found->second.bridges.size() == 1;
    }
}

bool pool_table::has_left(std::string_view name) const {
    const auto found = pools_.find(name);
    return found != pools_.end() && found->second.bridges.empty() && found->second.has_left;
}

bool pool_table::remove(const bridge_id& gone, time_point now) {
    const auto found = pools_.find(gone.pool);
    if (found == pools_.end() || found->second.bridges.erase(gone.instance) == 0) {
        return false;
    }
    found->second.without_bridges = now;
    drop_unstated(found->second);
    --bridge_count_;
    return true;
}

void pool_table::lose(const bridge_id& which, time_point now) {
    remove(which, now);
    if (lost_.size() >= max_bridges) { // the other is then not told
        lost_.clear();
    }
    lost_.insert(which);
}

std::vector<bridge_id> pool_table::lose_if(const condition& is_lost, time_point now) {
    std::vector<bridge_id> gone;
    for (const auto& [name, p] : pools_) {
        for (const auto& [instance, b] : p.bridges) {
            if (is_lost(instance, b)) {
                gone.push_back({name, instance});
            }
        }
    }
    for (const auto& each : gone) {
        lose(each, now);
    }
    return gone;
}

std::vector<bridge_id> pool_table::expire(time_point now) {
    return lose_if([now](const std::string&, const bridge& b) { return lost_at(b) <= now; }, now);
}

void pool_table::note_suspension(time_point now) {
    for (auto& [name, p] : pools_) {
        for (auto& [instance, b] : p.bridges) {
            b.heard = now;
        }
    }
}

void pool_table::clear(time_point now) {
    for (auto& [name, p] : pools_) {
        p.without_bridges = p.bridges.empty() ? p.without_bridges : now;
        p.bridges.clear();
        p.has_left = false; // it may return unheard
    }
    lost_.clear();
    bridge_count_ = 0;
}

void pool_table::note_connection(time_point now) {
    constexpr std::chrono::minutes at_least{1}; // the longest interval between heartbeats
    for (auto& [name, p] : pools_) {
        p.without_bridges = std::max(p.without_bridges, now + at_least - kept_for);
    }
}

bool pool_table::forget_pools(time_point now) {
    return std::erase_if(pools_, [now](const auto& each) {
               return each.second.bridges.empty() && each.second.without_bridges + kept_for <= now;
           }) != 0;
}

bool pool_table::set_names(const bridge_id& from, node_names said) {
    const auto found = pools_.find(from.pool);
    if (found == pools_.end()) {
        return false;
    }
    auto& p = found->second;
    const auto by = p.bridges.find(from.instance);
    if (by == p.bridges.end()) { // it is asked again when its heartbeat has arrived
        return false;
    }
    std::size_t others = 0;
    for (const auto& [name, each] : pools_) {
        for (const auto& [digest, nodes] : each.names) {
            others += name == from.pool && (digest == said.digest || digest == by->second.names) ? 0 : nodes.size();
        }
    }
    said.nodes.resize(std::min(said.nodes.size(), max_names - std::min(others, max_names)));
    const auto known = p.names.find(said.digest);
    if (by->second.names == said.digest && known != p.names.end() && known->second == said.nodes) {
        return false;
    }
    by->second.names = said.digest;
    p.names.insert_or_assign(std::move(said.digest), std::move(said.nodes));
    drop_unstated(p);
    return true;
}

bool pool_table::lacks_names(std::string_view of, std::string_view digest) const {
    const auto found = pools_.find(of);
    return found != pools_.end() && !found->second.names.contains(digest);
}

std::size_t pool_table::node_count(const pool& of) {
    std::set<std::string_view> nodes;
    for (const auto& [digest, some] : of.names) {
        nodes.insert(some.begin(), some.end());
    }
    return nodes.size();
}

bool pool_table::is_live(std::string_view name) const {
    const auto found = pools_.find(name);
    return found != pools_.end() && !found->second.bridges.empty();
}

bool pool_table::is_live(const bridge_id& which) const {
    const auto found = pools_.find(which.pool);
    return found != pools_.end() && found->second.bridges.contains(which.instance);
}

std::string_view pool_table::pool_of(std::string_view node, std::string_view except) const {
    std::string_view silent;
    for (const auto& [name, p] : pools_) {
        const bool has_it = std::ranges::any_of(
            p.names, [node](const auto& some) { return std::ranges::binary_search(some.second, node, std::less<>{}); });
        if (name == except || !has_it) {
            continue;
        }
        if (!p.bridges.empty()) {
            return name;
        }
        silent = silent.empty() ? std::string_view{name} : silent;
    }
    return silent;
}

std::string_view pool_table::publisher_of(std::string_view of, std::string_view noun) const {
    const auto found = pools_.find(of);
    std::tuple<bool, std::uint64_t, std::string_view> best;
    if (found != pools_.end()) {
        for (const auto& [instance, b] : found->second.bridges) {
            best = std::max(best, {!b.is_closing, hash_of(instance, noun), std::string_view{instance}});
        }
    }
    return std::get<std::string_view>(best);
}

std::string_view pool_table::taker_of(std::string_view of, std::uint32_t turn) const {
    std::vector<std::string_view> takers;
    if (const auto found = pools_.find(of); found != pools_.end()) {
        for (const auto& [instance, b] : found->second.bridges) {
            if (!b.is_closing) {
                takers.push_back(instance);
            }
        }
    }
    return takers.empty() ? std::string_view{} : takers[std::uint64_t{turn} * takers.size() >> 32U];
}

} // namespace cles::bridging
