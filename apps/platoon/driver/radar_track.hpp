// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/motion.hpp"
#include "platoon/driver/radar.hpp"

#include <array>

namespace platoon {

/// The motion of the vehicle ahead as its follower's radar sees it: a Kalman filter for position, velocity and
/// acceleration, in which the acceleration is Singer's process (1970). Ploeg et al. (2015) estimate it so for a vehicle
/// whose predecessor is silent.
class radar_track {
  public:
    explicit radar_track(const radar_setup& setup) : setup_(setup) {}

    /// \param self at the time of the measurement
    void measure(const echo& seen, const motion& self, double now);
    /// Whether it saw a vehicle a moment ago.
    [[nodiscard]] bool sees(double now) const noexcept { return known_ && now - measured_ < 4 * setup_.period; }
    /// The motion of its rear.
    [[nodiscard]] motion at(double now) const;

  private:
    void predict(double dt);
    void correct(std::size_t component, double measured, double variance);

    radar_setup setup_;
    bool known_ = false;
    double measured_ = 0;                             ///< when
    std::array<double, 3> estimate_{};                ///< position, velocity, acceleration
    std::array<std::array<double, 3>, 3> variance_{}; ///< of the errors of the estimate, with their covariances
};

} // namespace platoon
