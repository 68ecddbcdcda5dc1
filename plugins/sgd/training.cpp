// SPDX-License-Identifier: BSL-1.0
#include "training.hpp"

#include <algorithm>

namespace sgd {

training::training(const data_set& data, shard part, const schedule& how, const classifier& start)
    : data_(data), part_(part), how_(how), chance_(how.seed), now_(start) {}

bool training::step() {
    const auto until = std::min(how_.steps, done_ + stretch);
    auto c = now_; // in registers
    for (; done_ < until; ++done_) {
        const auto i = static_cast<std::size_t>(part_.first) + chance_.below(static_cast<std::uint32_t>(part_.count));
        const auto& p = data_[i];
        const auto pull = how_.rate * (c.value(p) - data_set::label(i));
        c.weights[0] -= pull * p.x;
        c.weights[1] -= pull * p.y;
        c.bias -= pull;
    }
    now_ = c;
    return done_ < how_.steps;
}

double training::part_done() const noexcept {
    return done_ >= how_.steps ? 1 : static_cast<double>(done_) / static_cast<double>(how_.steps);
}

} // namespace sgd
