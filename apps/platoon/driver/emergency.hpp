// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/motion.hpp"

#include <optional>

namespace platoon {

/// The time until two vehicles touch if neither changes its acceleration, s; infinite: they do not.
/// \param rear of the vehicle ahead
double time_to_collision(const motion& self, const motion& rear);

/// The constant deceleration by which a vehicle stays behind the one ahead, m/s², if that keeps its own until it
/// stands; 0: none is needed. It takes into account that brakes do not act at once.
double required_deceleration(const motion& self, const motion& rear);

/// The deceleration of emergency braking, m/s²; nothing: there is no emergency. It is one if both the time to collision
/// is short and braking is needed that is more than gentle. \param brake the maximum deceleration
std::optional<double> emergency_braking(const motion& self, const motion& rear, double brake);

} // namespace platoon
