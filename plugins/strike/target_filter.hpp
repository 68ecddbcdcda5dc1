// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "geo/tangent_plane.hpp"

#include <array>

namespace strike {

/// The variances of a place on the ground, in m².
struct covariance {
    double ee = 0, en = 0, nn = 0;
};

/// A target that moves at a nearly constant velocity: a Kalman filter, in which the acceleration is white noise.
class target_filter {
  public:
    /// \param sigma standard deviation of the place per axis, m \param sigma_v the same of the velocity, m/s
    target_filter(geo::plane_position at, geo::plane_position velocity, double sigma, double sigma_v);

    /// To the time `seconds` later, or earlier if they are negative.
    void predict(double seconds);
    /// How well a place that was measured fits: the squared Mahalanobis distance.
    [[nodiscard]] double distance(geo::plane_position measured, const covariance& noise) const;
    void correct(geo::plane_position measured, const covariance& noise);

    [[nodiscard]] geo::plane_position at() const noexcept { return {.east = x_[0], .north = x_[1]}; }
    [[nodiscard]] geo::plane_position velocity() const noexcept { return {.east = x_[2], .north = x_[3]}; }
    /// The standard deviation of the place, per axis, m.
    [[nodiscard]] double deviation() const noexcept;

  private:
    [[nodiscard]] covariance innovation(const covariance& noise) const noexcept;

    std::array<double, 4> x_;                  ///< east, north, and their velocities
    std::array<std::array<double, 4>, 4> p_{}; ///< the covariance of their errors
};

} // namespace strike
