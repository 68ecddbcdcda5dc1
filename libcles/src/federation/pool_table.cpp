// SPDX-License-Identifier: BSL-1.0
#include "federation/pool_table.hpp"

#include <algorithm>
#include <utility>

namespace cles::bridging {
namespace {

// As for nodes (docs/protocol.md, "Membership").
time_point lost_at(const pool_table::bridge& b) { return b.heard + b.interval * 7 / 2; }

std::uint64_t hash_of(std::string_view instance, std::string_view noun) noexcept {
    std::uint64_t hash = 0xcbf29ce484222325U;
    for (const auto text : {instance, noun}) {
        for (const char c : text) {
            hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
        }
    }
    // The last characters change only the lower bits so far.
    hash ^= hash >> 33U;
    hash *= 0xff51afd7ed558ccdU;
    return hash ^ (hash >> 33U);
}

} // namespace

pool_table::arrival pool_table::on_heartbeat(const bridge_id& from, const heartbeat& said, time_point now) {
    auto found = pools_.find(from.pool);
    if (found == pools_.end()) {
        if (pools_.size() >= max_pools) {
            return arrival::ignored;
        }
        found = pools_.emplace(from.pool, pool{}).first;
    }
    auto& bridges = found->second.bridges;
    const auto known = bridges.find(from.instance);
    if (known == bridges.end() && bridge_count_ >= max_bridges) {
        return arrival::ignored;
    }
    const bool fresh = known == bridges.end();
    auto& entry = fresh ? bridges[from.instance] : known->second;
    const auto since = fresh ? now : entry.since;
    entry = {.node = said.node, .interval = said.interval, .names = said.names, .heard = now, .since = since};
    if (!fresh) {
        return arrival::known;
    }
    ++bridge_count_;
    return lost_.erase(from) != 0 ? arrival::returned : arrival::fresh;
}

bool pool_table::remove(const bridge_id& gone) {
    const auto found = pools_.find(gone.pool);
    const bool removed = found != pools_.end() && found->second.bridges.erase(gone.instance) != 0;
    bridge_count_ -= removed ? 1 : 0;
    return removed;
}

std::vector<bridge_id> pool_table::expire(time_point now) {
    std::vector<bridge_id> gone;
    for (const auto& [name, p] : pools_) {
        for (const auto& [instance, b] : p.bridges) {
            if (lost_at(b) <= now) {
                gone.push_back({name, instance});
            }
        }
    }
    for (const auto& each : gone) {
        remove(each);
        if (lost_.size() >= max_bridges) { // the other is then not told
            lost_.clear();
        }
        lost_.insert(each);
    }
    return gone;
}

void pool_table::note_suspension(time_point now) {
    for (auto& [name, p] : pools_) {
        for (auto& [instance, b] : p.bridges) {
            b.heard = now;
        }
    }
}

void pool_table::clear() {
    for (auto& [name, p] : pools_) {
        p.bridges.clear();
    }
    lost_.clear();
    bridge_count_ = 0;
}

bool pool_table::set_names(std::string_view of, node_names said) {
    const auto found = pools_.find(of);
    if (found == pools_.end() || found->second.names == said) {
        return false;
    }
    std::size_t others = 0;
    for (const auto& [name, p] : pools_) {
        others += name == of ? 0 : p.names.nodes.size();
    }
    said.nodes.resize(std::min(said.nodes.size(), max_names - std::min(others, max_names)));
    found->second.names = std::move(said);
    return true;
}

bool pool_table::lacks_names(std::string_view of, std::string_view digest) const {
    const auto found = pools_.find(of);
    return found != pools_.end() && found->second.names.digest != digest;
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
        if (name == except || !std::ranges::binary_search(p.names.nodes, node, std::less<>{})) {
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
    std::pair<std::uint64_t, std::string_view> best;
    if (found != pools_.end()) {
        for (const auto& [instance, b] : found->second.bridges) {
            best = std::max(best, {hash_of(instance, noun), std::string_view{instance}});
        }
    }
    return best.second;
}

} // namespace cles::bridging
