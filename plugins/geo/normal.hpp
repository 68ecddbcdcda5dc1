// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "sgd/random_source.hpp"

#include <cmath>
#include <numbers>

namespace geo {

/// A normally distributed number, with mean 0 and variance 1 (Box and Muller).
inline double normal(sgd::random_source& chance) {
    const double uniform = 1 - (chance.within_one() + 1) / 2; // more than 0
    const double radius = std::sqrt(-2 * std::log(uniform));
    return radius * std::cos(std::numbers::pi * chance.within_one());
}

/// A number between two others, each as likely as the others.
inline double between(sgd::random_source& chance, double low, double high) {
    return low + (chance.within_one() + 1) / 2 * (high - low);
}

} // namespace geo
