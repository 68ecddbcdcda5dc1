// SPDX-License-Identifier: BSL-1.0
#include "core/ended_runs.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

void ended_runs::add(std::uint32_t epoch, run ended, time_point now) {
    if (most_ == 0) {
        return;
    }
    if (runs_.size() >= most_) {
        std::erase_if(runs_, [now](const auto& entry) { return entry.second.until <= now; });
    }
    if (runs_.size() >= most_ && !runs_.contains(epoch)) {
        runs_.erase(std::min_element(runs_.begin(), runs_.end(),
                                     [](const auto& a, const auto& b) { return a.second.until < b.second.until; }));
    }
    runs_.insert_or_assign(epoch, std::move(ended));
}

bool ended_runs::covers(std::string_view node, std::uint32_t epoch, std::uint64_t seq) const noexcept {
    const auto found = runs_.find(epoch);
    return found != runs_.end() && found->second.node == node && seq <= found->second.seq;
}

bool ended_runs::covers(std::uint32_t epoch, std::uint64_t seq) const noexcept {
    const auto found = runs_.find(epoch);
    return found != runs_.end() && seq <= found->second.seq;
}

} // namespace cles::core
