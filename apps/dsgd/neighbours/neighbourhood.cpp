// SPDX-License-Identifier: BSL-1.0
#include "neighbourhood.hpp"

#include "dsgd/median.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace dsgd {

void neighbourhood::trained(std::uint64_t round, digits::network own, double now_ms) {
    round_ = round;
    own_ = std::move(own);
    waits_since_ms_ = now_ms;
    for (auto& each : heard_) {
        each.second.erase(each.second.begin(), each.second.lower_bound(round));
    }
}

void neighbourhood::hear(const std::string& neighbour, std::uint64_t round, std::uint64_t degree,
                         digits::network network) {
    const bool is_one = std::find(neighbours_.begin(), neighbours_.end(), neighbour) != neighbours_.end();
    if (!is_one || (round_ != 0 && network.form != own_.form)) {
        return;
    }
    last_[neighbour] = round;
    auto& its = heard_[neighbour];
    if (round >= round_) {
        its.insert_or_assign(round, told{.degree = degree, .network = std::move(network)});
        absent_.erase(neighbour);
    }
    // One that waits for this node is at most a round ahead. One that does not may be anywhere.
    constexpr std::size_t most = 2;
    while (its.size() > most) {
        its.erase(std::prev(its.end(), 2)); // the last one shows how far it is
    }
}

std::uint64_t neighbourhood::last_round(const std::string& neighbour) const {
    const auto found = last_.find(neighbour);
    return found == last_.end() ? 0 : found->second;
}

double neighbourhood::limit_ms() const { return late_factor * median(took_ms_) + late_more_ms; }

bool neighbourhood::ready(double now_ms) {
    const auto waited_ms = now_ms - waits_since_ms_;
    for (const auto& neighbour : neighbours_) {
        const auto its = heard_.find(neighbour);
        const bool is_there = its != heard_.end() && !its->second.empty(); // this round, or a later one
        if (is_there || absent_.contains(neighbour)) {
            continue;
        }
        const bool was_heard = its != heard_.end() && !took_ms_.empty();
        if (waited_ms <= (was_heard ? limit_ms() : patience_ms_)) {
            return false;
        }
        absent_.insert(neighbour);
    }
    return true;
}

digits::network neighbourhood::mix(double now_ms) {
    std::vector<digits::weighted_network> parts;
    double rest = 1;
    mixed_.clear();
    for (auto& [neighbour, its] : heard_) {
        if (its.empty()) {
            continue;
        }
        const auto found = its.find(round_);
        const auto& its_last = found != its.end() ? found->second : its.rbegin()->second;
        if (its_last.network.form == own_.form) {
            const auto larger = std::max<std::uint64_t>(degree(), its_last.degree);
            const auto weight = 1 / (1 + static_cast<double>(larger));
            parts.push_back({.of = &its_last.network, .weight = weight});
            rest -= weight;
            mixed_.push_back(neighbour);
        }
    }
    parts.push_back({.of = &own_, .weight = rest});
    constexpr std::size_t most_rounds = 100;
    if (took_ms_.size() == most_rounds) {
        took_ms_.erase(took_ms_.begin());
    }
    took_ms_.push_back(now_ms - last_ms_);
    last_ms_ = now_ms;
    return average(parts);
}

std::uint64_t neighbourhood::next_round() const {
    std::uint64_t newest = 0;
    for (const auto& each : heard_) {
        newest = std::max(newest, each.second.empty() ? 0 : each.second.rbegin()->first);
    }
    // A neighbour that waits for this node has told the next round at most.
    return newest > round_ + 1 ? newest + 1 : round_ + 1;
}

} // namespace dsgd
