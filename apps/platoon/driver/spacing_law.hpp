// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/motion.hpp"

namespace platoon {

/// Another vehicle, and the desired distance behind it (front to front).
struct reference {
    motion where{};
    double command = 0;
    double distance = 0;
};

/// Swaroop and Hedrick's law for constant spacing (1999): sliding control of
/// S = e' + q1 e + q3 (v - v_leader) + q4 (distance to the leader's error), with S' = -lambda S.
struct gains {
    double q1 = 1.04, lambda = 0.76, q3 = 0.59, q4 = 0.021;
    /// The share of the difference between command and acceleration that is fed forward (0: the acceleration, 1: the
    /// command), for the one ahead and the leader.
    double ahead_lead = 0.046, leader_lead = 0.13;
    double max_error = 8; ///< m: larger errors are limited to this, so that a vehicle far behind does not race
};

/// The gains for this number of updates per second, which `cles-platoon tune` found.
gains gains_for(double hz);

/// The distance to keep, front to front: `spacing`, and, if the own brakes are weaker, the difference of the distances
/// in which the two come to a halt from this speed, so that no collision follows if both brake as hard as they can.
double wanted_distance(double spacing, double speed, double own_brake, double brake_ahead);

/// The leader's term in the numerator of the law, m/s², without its weight.
double leader_part(const gains& law, const motion& self, const reference& leader);
/// The same without the leader, from the term of the vehicle ahead: both have the same leader.
double leader_part_via(const gains& law, const motion& self, const reference& ahead, double part_of_ahead);
/// Its largest absolute value, if no speed or acceleration exceeds these.
double most_leader_part(const gains& law, double speed, double acceleration);

/// The acceleration to command. \param weight of the leader: 1: full; 0: only the one ahead counts
double spacing_law(const gains& law, const motion& self, const reference& ahead, double from_leader, double weight);

} // namespace platoon
