// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/clock_difference.hpp"

#include <algorithm>

namespace platoon {

void clock_difference::add(double sent, double told, double received) {
    last_[count_ % last_.size()] = {.difference = (sent + received) / 2 - told, .took = received - sent};
    ++count_;
}

std::optional<double> clock_difference::value() const {
    if (count_ == 0) {
        return std::nullopt;
    }
    const auto end = last_.begin() + static_cast<std::ptrdiff_t>(std::min(count_, last_.size()));
    return std::min_element(last_.begin(), end, [](const auto& a, const auto& b) { return a.took < b.took; })
        ->difference;
}

} // namespace platoon
