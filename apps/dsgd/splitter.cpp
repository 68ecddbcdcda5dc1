// SPDX-License-Identifier: BSL-1.0
#include "splitter.hpp"

#include <algorithm>

namespace dsgd {

splitter::splitter(std::uint64_t points, std::size_t slots, std::uint64_t least_points)
    : points_(points), least_points_(static_cast<double>(least_points)),
      left_(points), open_{{.first = 0, .count = points}}, slots_(slots) {}

sgd::shard splitter::next(std::size_t slot, double now_ms) {
    auto& state = slots_[slot];
    state.begun_ms = now_ms;
    state.shard = {};
    if (left_ == 0) {
        return {};
    }
    auto& range = open_.back();
    const auto count = wanted(state);
    // A rest that is not worth a shard belongs to it.
    const bool last = count + least(state) > static_cast<double>(range.count);
    state.shard = {.first = range.first, .count = last ? range.count : static_cast<std::uint64_t>(count)};
    left_ -= state.shard.count;
    range.first += state.shard.count;
    range.count -= state.shard.count;
    if (last) {
        open_.pop_back();
    }
    return state.shard;
}

double splitter::wanted(const slot_state& slot) const {
    if (slot.speed == 0) {
        const auto slots = static_cast<double>(slots_.size());
        const auto first = static_cast<double>(points_) / slots / static_cast<double>(first_divisor);
        return std::max(least(slot), std::min(first, static_cast<double>(left_) / slots / rest_divisor));
    }
    double sum = 0;
    double measured = 0;
    for (const auto& each : slots_) {
        sum += each.speed;
        measured += each.speed > 0 ? 1 : 0;
    }
    // Slots that have not ended their first shard count as an average one.
    const auto all = sum / measured * static_cast<double>(slots_.size());
    const auto left_ms = static_cast<double>(left_) / all;
    // At the end, its share of all that is left.
    const auto ms = std::max(left_ms / rest_divisor, std::min(left_ms, least_shard_ms));
    return std::max(least(slot), slot.speed * ms);
}

double splitter::least(const slot_state& slot) const {
    return std::max(least_points_, slot.speed * least_shard_ms / 4);
}

void splitter::done(std::size_t slot, double now_ms) {
    auto& state = slots_[slot];
    state.speed = static_cast<double>(state.shard.count) / std::max(now_ms - state.begun_ms, 1e-3);
}

void splitter::lost(std::size_t slot) {
    auto& state = slots_[slot];
    open_.push_back(state.shard);
    left_ += state.shard.count;
    state = {};
}

} // namespace dsgd
