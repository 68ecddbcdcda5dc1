// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace platoon {

/// The manoeuvre of the leader: it drives at a constant speed, brakes hard, drives slowly, and accelerates again. Or
/// its acceleration is a sine, which shows the response to one frequency.
struct manoeuvre {
    double speed = 25;   ///< m/s
    double slow = 10;    ///< m/s, after braking
    double brake_at = 5; ///< s
    double brake = 5;    ///< m/s²
    double speed_up = 1; ///< m/s²
    double slow_for = 5; ///< s
    double jerk = 5;     ///< m/s³, the maximum change of its commands
    double period = 0;   ///< s, of the sine, from `brake_at` on; 0: it brakes instead
    double sine = 1;     ///< m/s², the amplitude of the sine

    /// The acceleration commanded at that time.
    [[nodiscard]] double command(double t) const;
    /// When it begins to accelerate again; infinite: never, because it is a sine.
    [[nodiscard]] double recovery() const;
    /// When it has its initial speed again, or enough periods of the sine are over.
    [[nodiscard]] double end() const;
    /// When the response to the sine counts as periodic.
    [[nodiscard]] double periodic_from() const;
    /// The phase of the sine at that time, in radians.
    [[nodiscard]] double phase(double t) const;
};

} // namespace platoon
