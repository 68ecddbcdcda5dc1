// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "geo/tangent_plane.hpp"

#include <vector>

namespace fmv {

/// How another sensor sees the same targets.
struct plot_statistics {
    double deviation = 0; ///< m, standard deviation of a plot, per axis
    double detected = 0;  ///< the share of targets that have a plot
    double others = 0;    ///< plots of anything else, per m²
};

/// The error that all places of a camera's map have in common, because the camera's position and direction are not
/// exactly known: estimated from the plots of another sensor, which has no such error.
///
/// Which plot is of which target is not known: neighbours are nearer to each other than the error is large. So it keeps
/// the probability of each error, on a grid, and each target multiplies it by how likely its plots are then: a wrong
/// assignment fits one target at one time, and the error fits all of them always. What has long been seen counts less,
/// because the error may drift.
class camera_error {
  public:
    /// \param deviation of the error before anything is known, per axis, m
    explicit camera_error(double deviation);

    /// What the other sensor has seen when the targets were at these places by the camera.
    void observe(const std::vector<geo::plane_position>& places, const std::vector<geo::plane_position>& plots,
                 const plot_statistics& of_plots);

    /// Whether the plots are, beyond doubt, of the same targets. Until then the error is not known.
    [[nodiscard]] bool is_known() const noexcept;
    /// The error: a place by the camera minus this is the place. m
    [[nodiscard]] geo::plane_position mean() const noexcept { return mean_; }
    /// The standard deviation of what is wrong with it, per axis, m.
    [[nodiscard]] double deviation() const noexcept { return deviation_; }

  private:
    void forget();
    void weigh(const geo::plane_position& place, const std::vector<geo::plane_position>& plots,
               const plot_statistics& of_plots);
    double normalise();
    void summarise();

    double step_ = 0; ///< of the grid, m
    std::vector<double> axis_;
    std::vector<double> prior_;  ///< logarithms, as of the next
    std::vector<double> belief_; ///< of each error, row by row from the west
    std::vector<double> ratio_;  ///< of a target, while it is weighed
    double evidence_ = 0;        ///< logarithm of the odds that the plots are of these targets
    geo::plane_position mean_{};
    double deviation_;
};

} // namespace fmv
