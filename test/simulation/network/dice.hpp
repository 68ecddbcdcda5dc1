// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>

namespace cles::simulation {

/// Random numbers from a seed, the same on every machine: splitmix64 (Steele, Lea, Flood 2014).
class dice {
  public:
    explicit dice(std::uint64_t seed) noexcept : state_(seed) {}

    std::uint64_t next() noexcept {
        state_ += 0x9e3779b97f4a7c15U;
        auto z = state_;
        z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
        z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
        return z ^ (z >> 31U);
    }
    /// At least 0, less than `most`.
    unsigned below(unsigned most) noexcept { return static_cast<unsigned>(next() % most); }
    /// Both bounds inclusive.
    unsigned between(unsigned least, unsigned most) noexcept { return least + below(most - least + 1); }
    bool chance(unsigned per_mille) noexcept { return below(1000) < per_mille; }
    std::chrono::microseconds within(std::chrono::microseconds span) noexcept {
        return std::chrono::microseconds{span.count() == 0 ? 0 : next() % static_cast<std::uint64_t>(span.count())};
    }

  private:
    std::uint64_t state_;
};

} // namespace cles::simulation
