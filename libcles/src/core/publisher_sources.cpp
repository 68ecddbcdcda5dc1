// SPDX-License-Identifier: BSL-1.0
#include "core/publisher_sources.hpp"

#include "core/presence.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

publisher_sources::verdict publisher_sources::look(std::string_view node, const group_source& from, time_point now) {
    if (const auto* const run = others_.announced(node)) {
        return !run->sends_from(from)      ? verdict::refused
               : run->said.sources.empty() ? verdict::taken
                                           : verdict::one_of_several;
    }
    if (const auto found = ties_.find(node); found != ties_.end()) {
        const bool same = found->second.to == from;
        if (!same && now - found->second.heard < silent_after) {
            return verdict::refused;
        }
        found->second = {from, now};
        return same ? verdict::taken : verdict::another;
    }
    if (ties_.size() >= most_ && !ties_.empty()) {
        ties_.erase(std::min_element(ties_.begin(), ties_.end(),
                                     [](const auto& a, const auto& b) { return a.second.heard < b.second.heard; }));
    }
    ties_.emplace(std::string{node}, tie{from, now});
    return verdict::taken;
}

void publisher_sources::note_foreign(const group_source& from, time_point until) {
    if (foreign_.size() >= most_ && !foreign_.contains(from)) {
        foreign_.erase(std::min_element(foreign_.begin(), foreign_.end(),
                                        [](const auto& a, const auto& b) { return a.second < b.second; }));
    }
    if (most_ != 0) {
        foreign_.insert_or_assign(from, until);
    }
}

} // namespace cles::core
