// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/motion.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {

namespace {

motion integrate(const motion& from, double command, double lag, double dt) {
    const double rest = (from.a - command) * std::exp(-dt / lag); // the remaining change of the acceleration
    const double gained = (from.a - command - rest) * lag;
    return {.x = from.x + from.v * dt + command * dt * dt / 2 + ((from.a - command) * dt - gained) * lag,
            .v = from.v + command * dt + gained,
            .a = command + rest};
}

} // namespace

double compensated(double command, double acceleration, double lag) {
    return command + (lag / platoon_lag - 1) * (command - acceleration);
}

motion advance(const motion& from, double command, double lag, double dt) {
    const auto to = integrate(from, command, lag, dt);
    if (to.v > 0 || dt <= 0) {
        return to;
    }
    double moving = 0; // it stops between these times
    double still = dt;
    for (int i = 0; i < 40; ++i) {
        const double middle = (moving + still) / 2;
        (integrate(from, command, lag, middle).v > 0 ? moving : still) = middle;
    }
    return {.x = std::max(from.x, integrate(from, command, lag, moving).x), .v = 0, .a = 0};
}

} // namespace platoon
