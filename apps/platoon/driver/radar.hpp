// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/random_source.hpp"

#include <optional>

namespace platoon {

/// What a radar measures of the vehicle ahead in the lane.
struct echo {
    double range = 0; ///< m, from the own front to its rear
    double rate = 0;  ///< m/s, of the range
};

/// A radar for adaptive cruise control. docs/platoon.md names the source of these figures.
struct radar_setup {
    bool fitted = true;
    double period = 0.08;     ///< s
    double range_noise = 0.1; ///< m, standard deviation
    double rate_noise = 0.12; ///< m/s, standard deviation
    double reach = 150;       ///< m
};

/// A simulated radar: the truth with noise, determined by a seed.
class radar {
  public:
    radar(const radar_setup& setup, std::uint64_t seed) : setup_(setup), random_(seed) {}

    /// Nothing, if there is no vehicle within its reach. \param truth without noise
    std::optional<echo> measure(const echo& truth) {
        if (!setup_.fitted || truth.range < 0 || truth.range > setup_.reach) {
            return std::nullopt;
        }
        const double range = truth.range + setup_.range_noise * random_.normal();
        return echo{.range = range, .rate = truth.rate + setup_.rate_noise * random_.normal()};
    }

  private:
    radar_setup setup_;
    random_source random_;
};

} // namespace platoon
