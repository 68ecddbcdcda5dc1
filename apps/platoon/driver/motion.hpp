// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace platoon {

/// The motion of a vehicle along its lane: position of its front in metres, velocity, acceleration.
struct motion {
    double x = 0, v = 0, a = 0;
};

/// The properties of all vehicles.
struct vehicle_limits {
    double length = 5;       ///< m
    double lag = 0.3;        ///< s, of engine and brakes: the acceleration follows its command in the first order
    double brake = 8;        ///< m/s², the maximum deceleration
    double accelerate = 2.5; ///< m/s²
};

/// The length of a vehicle that does not state its own, for which spacings are meant, m.
inline constexpr double usual_length = vehicle_limits{}.length;

/// The lag of the platoon: all vehicles respond with it to what their controllers command, whatever their own lag is.
inline constexpr double platoon_lag = vehicle_limits{}.lag;

/// What an actuator with this lag has to be commanded so that the acceleration follows `command` with the lag of the
/// platoon.
double compensated(double command, double acceleration, double lag);

/// Its motion `dt` later with a constant command; exact for any `dt`. It does not roll backwards.
motion advance(const motion& from, double command, double lag, double dt);

} // namespace platoon
