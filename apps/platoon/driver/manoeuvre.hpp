// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace platoon {

/// The manoeuvre of the leader: it drives at a constant speed, brakes hard, drives slowly, and accelerates again.
struct manoeuvre {
    double speed = 25;   ///< m/s
    double slow = 10;    ///< m/s, after braking
    double brake_at = 5; ///< s
    double brake = 5;    ///< m/s²
    double speed_up = 1; ///< m/s²
    double slow_for = 5; ///< s
    double jerk = 5;     ///< m/s³, the maximum change of its commands

    /// The acceleration commanded at that time.
    [[nodiscard]] double command(double t) const;
    /// When it has its initial speed again.
    [[nodiscard]] double end() const;
};

} // namespace platoon
