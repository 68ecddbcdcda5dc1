// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <optional>
#include <random>

namespace platoon {

/// A bad radio: it loses some updates and delays the others, determined by a seed.
class impairment {
  public:
    /// \param loss the share that is lost, 0 to 1 \param delay s, the maximum delay; the minimum is half of it
    impairment(double loss, double delay, std::uint64_t seed) : loss_(loss), delay_(delay), generator_(seed) {}

    /// The delay of the next update; nothing: it is lost.
    std::optional<double> next() {
        const bool lost = draw() < loss_;
        const double later = delay_ * (0.5 + draw() / 2);
        return lost ? std::nullopt : std::optional{later};
    }

  private:
    // From 0 to below 1; the same everywhere, which the standard's distributions are not.
    double draw() { return static_cast<double>(generator_() >> 11U) * 0x1p-53; }

    double loss_, delay_;
    std::mt19937_64 generator_;
};

} // namespace platoon
