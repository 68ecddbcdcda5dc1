// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>

namespace sgd {

/// Numbers that are the same for a seed on every machine and with every standard library: splitmix64 (Steele, Lea and
/// Flood, "Fast splittable pseudorandom number generators", 2014).
class random_source {
  public:
    explicit random_source(std::uint64_t seed) noexcept : state_(seed) {}

    std::uint64_t next() noexcept {
        auto z = state_ += 0x9e3779b97f4a7c15U;
        z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
        z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
        return z ^ (z >> 31U);
    }
    /// From 0 on, and below the bound, each as likely as the others but for one part in 2^32.
    std::uint32_t below(std::uint32_t bound) noexcept {
        return static_cast<std::uint32_t>(((next() >> 32U) * bound) >> 32U);
    }
    /// From -1 to 1.
    double within_one() noexcept { return static_cast<double>(next() >> 11U) * 0x1p-52 - 1; }

  private:
    std::uint64_t state_;
};

} // namespace sgd
