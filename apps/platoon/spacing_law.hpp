// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "motion.hpp"

namespace platoon {

/// Another vehicle, and how far behind it one means to be (front to front).
struct mark {
    motion where{};
    double command = 0;
    double distance = 0;
};

/// Swaroop and Hedrick's law for constant spacing (1999): sliding control of
/// S = e' + q1 e + q3 (v - v_leader) + q4 (distance to the leader's error), with S' = -lambda S.
struct gains {
    double q1 = 1.04, lambda = 0.76, q3 = 0.59, q4 = 0.021;
    /// How much of what the actuators still owe to their command is fed forward with the acceleration (0: none of it,
    /// 1: the command itself), of the one ahead and of the leader.
    double ahead_lead = 0.046, leader_lead = 0.13;
    double most_error = 8; ///< m: errors count no more than that, so that a vehicle far behind does not race
};

/// The acceleration to be commanded. \param weight 1: the leader counts in full; 0: only the one ahead does
double spacing_law(const gains& by, const motion& self, const mark& ahead, const mark& leader, double weight);

} // namespace platoon
