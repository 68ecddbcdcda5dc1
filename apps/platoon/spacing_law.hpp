// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "motion.hpp"

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

/// The acceleration to command. \param weight of the leader: 1: full; 0: only the one ahead counts
double spacing_law(const gains& law, const motion& self, const reference& ahead, const reference& leader,
                   double weight);

} // namespace platoon
