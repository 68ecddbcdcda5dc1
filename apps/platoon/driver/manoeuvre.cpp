// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/manoeuvre.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace platoon {
namespace {

constexpr double settling_time = 30;   // s, at least, until the response to a sine is periodic, ...
constexpr double settling_periods = 4; // ... and its periods
constexpr double periods_measured = 4;

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
    if (period > 0) {
        return t < brake_at ? 0 : sine * std::sin(phase(t));
    }
    return trapezoid(t - recovery(), speed - slow, speed_up, jerk) - trapezoid(t - brake_at, speed - slow, brake, jerk);
}

double manoeuvre::recovery() const {
    return period > 0 ? INFINITY : brake_at + (speed - slow) / brake + brake / jerk + slow_for;
}

double manoeuvre::end() const {
    return period > 0 ? periodic_from() + periods_measured * period
                      : recovery() + (speed - slow) / speed_up + speed_up / jerk;
}

double manoeuvre::periodic_from() const {
    return brake_at + std::max(settling_periods, std::ceil(settling_time / period)) * period;
}

double manoeuvre::phase(double t) const { return 2 * std::numbers::pi * (t - brake_at) / period; }

} // namespace platoon
