// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "order.hpp"
#include "own_sensor.hpp"
#include "target_filter.hpp"

#include <cstdint>
#include <optional>

namespace strike {

/// Where the aircraft is, and what it has.
struct aircraft_state {
    geo::geographic at{};
    double height = 0;       ///< m above the ground
    double speed = 0;        ///< of a weapon, m/s
    std::uint64_t scans = 0; ///< of its own sensor, that are fused with the track of an order; 0: the track alone
};

/// 800 m west of the simulated traffic, with weapons of 400 m/s.
aircraft_state default_state(std::uint64_t scans = 30);

/// Where a weapon that is released now meets the target.
struct aim {
    geo::geographic at{};
    double after_s = 0;
    double sigma = 0;        ///< m, standard deviation of the place, per axis
    std::uint64_t plots = 0; ///< of its own sensor, that were taken for the target
};

/// What a place measured by the sensor may be away from where a target is predicted, and still be the target's: 0.997
/// of a chi-squared distribution with two degrees of freedom.
constexpr double gate = 11.8;

/// The plot of a scan that is nearest to where a target is predicted, if it is within the gate; else null.
const plot* nearest_plot(const scan& from, const target_filter& target);

/// The target of an order, now.
struct fused_target {
    target_filter target;
    std::uint64_t plots = 0; ///< of its own sensor, that were taken for the target
    double misfit = 0;       ///< of these to the track: a squared Mahalanobis distance, of place and velocity
    bool ambiguous = false;  ///< the plots of another vehicle fit nearly as well
};

/// Fuses the track of an order with what the aircraft's own sensor has seen. The track knows the velocity best, and
/// which vehicle is meant; the own plots do not have the errors of the other aircraft's position and camera.
fused_target fuse(const order& what, double now, const aircraft_state& own, own_sensor& sensor);

/// Aims a weapon that is released now.
/// \param plane whose origin is the aircraft
/// \return nothing, if the target gets away
std::optional<aim> aim_at(const fused_target& what, const aircraft_state& own, const geo::tangent_plane& plane);

/// Fuses and aims.
std::optional<aim> engage(const order& what, double now, const aircraft_state& own, own_sensor& sensor);

} // namespace strike
