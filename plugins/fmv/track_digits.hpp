// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <cmath>

/// What is stated of a track has no more digits than it is accurate, because fewer digits make a message shorter.

namespace fmv {

inline double hundredths(double value) { return std::round(value * 1e2) / 1e2; }
inline double to_a_centimetre(double degrees) { return std::round(degrees * 1e7) / 1e7; }

/// A standard deviation, m or m/s. Never 0: a track that claims to be exact cannot be fused.
inline double stated_deviation(double value) {
    constexpr double least = 0.01;
    return std::max(hundredths(value), least);
}

} // namespace fmv
