// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>

namespace platoon {

struct interval {
    double low = 0, high = 1;
};

/// The 95 % confidence interval of a rate after Wilson (1927), which holds for rare failures, and for none, too.
interval wilson_interval(std::uint64_t failures, std::uint64_t trials);

} // namespace platoon
