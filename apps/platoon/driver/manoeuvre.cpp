// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/manoeuvre.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {
namespace {

// Up to `level` and back to 0, both at `jerk`, with an area that equals the `change` of speed.
double trapezoid(double t, double change, double level, double jerk) {
    if (change <= 0) {
        return 0;
    }
    level = std::min(level, std::sqrt(change * jerk));
    const double length = change / level + level / jerk;
    return std::max(0.0, std::min({level, jerk * t, jerk * (length - t)}));
}

} // namespace

double manoeuvre::command(double t) const {
    const double again = brake_at + (speed - slow) / brake + brake / jerk + slow_for;
    return trapezoid(t - again, speed - slow, speed_up, jerk) - trapezoid(t - brake_at, speed - slow, brake, jerk);
}

double manoeuvre::end() const {
    return brake_at + (speed - slow) / brake + brake / jerk + slow_for + (speed - slow) / speed_up + speed_up / jerk;
}

} // namespace platoon
