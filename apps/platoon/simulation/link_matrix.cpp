// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulation/link_matrix.hpp"

#include <algorithm>

namespace platoon {

link_matrix::link_matrix(const gilbert_elliott& losses, double delay, std::uint64_t seed)
    : losses_(losses), delay_(delay), seed_(seed) {}

std::optional<double> link_matrix::next(std::size_t from, std::size_t to) {
    to_.resize(std::max(to_.size(), to + 1));
    auto& links = to_[to];
    links.resize(std::max(links.size(), from + 1));
    auto& one = links[from];
    if (!one) {
        one.emplace(link{.how = impairment{losses_, delay_, seed_ * 1'000'000 + to * 1000 + from}});
    }
    const auto later = one->how.next();
    ++(later ? one->carried.delivered : one->carried.lost);
    return later;
}

link_matrix::count link_matrix::counted(std::size_t from, std::size_t to) const {
    return to < to_.size() && from < to_[to].size() && to_[to][from] ? to_[to][from]->carried : count{};
}

} // namespace platoon
