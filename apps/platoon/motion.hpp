// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace platoon {

/// A vehicle along its lane: where its front is, in metres, and how that changes.
struct motion {
    double x = 0, v = 0, a = 0;
};

/// What all vehicles have in common.
struct vehicle_limits {
    double length = 5;       ///< m
    double lag = 0.3;        ///< s, of engine and brakes: the acceleration follows its command in the first order
    double brake = 8;        ///< m/s², the most that the brakes can do
    double accelerate = 2.5; ///< m/s²
};

/// Where it is `dt` later when the command stays what it is; exact for any `dt`. It does not roll backwards.
motion advance(const motion& from, double command, double lag, double dt);

} // namespace platoon
