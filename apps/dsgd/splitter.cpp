// SPDX-License-Identifier: BSL-1.0
#include "splitter.hpp"

#include <algorithm>

namespace dsgd {

splitter::splitter(std::uint64_t points, std::size_t slots) : points_(points), slots_(slots) {}

sgd::shard splitter::next(std::size_t slot) {
    const auto left = points_ - next_;
    const auto count = wanted(slots_[slot]);
    // A rest that would be smaller than half a shard belongs to it.
    const bool last = count * 1.5 >= static_cast<double>(left);
    const sgd::shard shard{.first = next_, .count = last ? left : static_cast<std::uint64_t>(count)};
    next_ += shard.count;
    slots_[slot].points = static_cast<double>(shard.count);
    return shard;
}

double splitter::wanted(const slot_state& slot) const {
    if (slot.speed == 0) {
        return std::max(1.0, static_cast<double>(points_) / static_cast<double>(slots_.size() * first_part));
    }
    double sum = 0;
    double measured = 0;
    for (const auto& each : slots_) {
        sum += each.speed;
        measured += each.speed > 0 ? 1 : 0;
    }
    // Slots that have not ended their first shard count as an average one.
    const auto all = sum / measured * static_cast<double>(slots_.size());
    const auto left_ms = static_cast<double>(points_ - next_) / all;
    const auto ms = std::max(left_ms / 2, std::min(left_ms, least_ms)); // at the end, its share of all that is left
    return std::max(1.0, slot.speed * std::max(ms, least_ms / 4));
}

void splitter::done(std::size_t slot, double now_ms) {
    auto& state = slots_[slot];
    state.speed = state.points / std::max(now_ms - state.begun_ms, 1e-3);
    state.begun_ms = now_ms;
}

} // namespace dsgd
