// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulation/wilson.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {

interval wilson_interval(std::uint64_t failures, std::uint64_t trials) {
    if (trials == 0) {
        return {};
    }
    constexpr double z = 1.959963984540054; // of the normal distribution, 95 % are within
    const auto n = static_cast<double>(trials);
    const double rate = static_cast<double>(failures) / n;
    const double middle = (rate + z * z / (2 * n)) / (1 + z * z / n);
    const double half = z * std::sqrt(rate * (1 - rate) / n + z * z / (4 * n * n)) / (1 + z * z / n);
    return {.low = failures == 0 ? 0 : std::max(0.0, middle - half),
            .high = failures == trials ? 1 : std::min(1.0, middle + half)};
}

} // namespace platoon
