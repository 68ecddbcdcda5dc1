// SPDX-License-Identifier: BSL-1.0
#include "core/lost_nodes.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

void lost_nodes::add(std::string_view name, std::string_view url, time_point now) {
    if (url.empty() || most_ == 0) {
        return;
    }
    std::erase_if(lost_, [name](const node& n) { return n.name == name; });
    node lost{std::string{name}, std::string{url}, now + remembered};
    if (lost_.size() < most_) {
        lost_.push_back(std::move(lost));
    } else {
        lost_[jitter_.below(lost_.size())] = std::move(lost);
    }
}

std::optional<lost_nodes::node> lost_nodes::any(const presence& others, time_point now) {
    std::erase_if(lost_, [&](const node& n) { return n.until <= now || others.find(n.name); });
    auto candidates = lost_;
    others.each([&](const presence::known& k) {
        if (k.suspect && !k.where.empty()) {
            candidates.push_back({std::string{k.node}, std::string{k.where}, {}});
        }
    });
    if (candidates.empty()) {
        return {};
    }
    return std::move(candidates[jitter_.below(candidates.size())]);
}

} // namespace cles::core
