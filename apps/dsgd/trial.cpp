// SPDX-License-Identifier: BSL-1.0
#include "trial.hpp"

#include "sgd/parallel.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace dsgd {

std::vector<double> speeds(const std::vector<sgd::trained>& parts) {
    std::vector<double> out;
    for (const auto& part : parts) {
        double count = 0;
        double steps = 0;
        double ms = 0;
        for (const auto& other : parts) {
            if (other.node == part.node) {
                ++count;
                steps += static_cast<double>(other.steps);
                ms = std::max(ms, other.after_ms.value_or(other.ms));
            }
        }
        out.push_back(steps / ms / count);
    }
    return out;
}

trial::trial(std::uint64_t points, std::size_t shards, const sgd::order& work, std::vector<std::string> targets)
    : points_(points), most_epochs_(std::max<std::uint64_t>(1, work.epochs.value_or(1) / most_divisor)), what_(work),
      targets_(std::move(targets)), weights_(shards, 1) {
    what_.epochs = std::max<std::uint64_t>(1, work.epochs.value_or(1) / first_divisor);
}

board trial::attempt() const {
    const auto even = sgd::divide(points_, std::vector<double>(weights_.size(), 1));
    board out{sgd::orders_for(even, what_), targets_};
    out.late_after(late_factor);
    return out;
}

void trial::take(const board& all) {
    const auto& parts = all.parts();
    std::vector<std::string> nodes;
    bool lost = false;
    shortest_ms_ = parts.front().ms;
    for (const auto& part : parts) {
        lost = lost || part.node != targets_[nodes.size() % targets_.size()];
        nodes.push_back(part.node);
        shortest_ms_ = std::min(shortest_ms_, part.ms);
    }
    targets_ = std::move(nodes);
    weights_ = speeds(parts);
    spent_ms_ += all.spent().elapsed_ms;
    ++attempts_;
    if (lost) {
        return;
    }
    finished_ = shortest_ms_ >= least_trial_ms || what_.epochs == most_epochs_;
    // A quarter more, because the next one may be faster. At least twice as much, so that it comes to an end.
    const auto times_more = std::max(2.0, 1.25 * least_trial_ms / std::max(shortest_ms_, 1e-3));
    const auto epochs = std::ceil(times_more * static_cast<double>(what_.epochs.value_or(1)));
    what_.epochs = epochs < static_cast<double>(most_epochs_) ? static_cast<std::uint64_t>(epochs) : most_epochs_;
}

} // namespace dsgd
