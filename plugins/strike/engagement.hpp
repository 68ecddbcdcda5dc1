// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "order.hpp"
#include "own_sensor.hpp"

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

/// Fuses the track of an order with what the aircraft's own sensor has seen, and aims. The track knows the velocity
/// best, and which vehicle is meant; the own plots do not have the errors of the other aircraft's position and camera.
/// \return nothing, if the target gets away
std::optional<aim> engage(const order& what, double now, const aircraft_state& own, own_sensor& sensor);

} // namespace strike
