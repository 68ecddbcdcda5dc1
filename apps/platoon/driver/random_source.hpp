// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

namespace platoon {

/// Random numbers that are the same everywhere, which those of the standard's distributions are not.
class random_source {
  public:
    explicit random_source(std::uint64_t seed) : generator_(seed) {}

    /// From 0 to below 1.
    double uniform() { return static_cast<double>(generator_() >> 11U) * 0x1p-53; }
    /// Normally distributed, with mean 0 and variance 1 (Box and Muller).
    double normal() {
        const double radius = std::sqrt(-2 * std::log(1 - uniform()));
        return radius * std::cos(2 * std::numbers::pi * uniform());
    }

  private:
    std::mt19937_64 generator_;
};

} // namespace platoon
