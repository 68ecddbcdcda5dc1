// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/drive/recording.hpp"
#include "platoon/simulation/simulation.hpp"

#include <string>

namespace platoon {

/// Simulates the scenario with `seeds` seeds from its own on, and prints the result of each; of more than 20, only that
/// of all.
/// \param record a file for the first of them; empty: none
/// \return 1 if vehicles collided, or a platoon stood still or fell apart; 4 if the manoeuvre did not end; otherwise 0
int simulate_command(scenario what, unsigned seeds, bool json, const std::string& record);

/// Searches the gains of the spacing law, and prints each improvement and the result. The search changes one gain at a
/// time, in smaller and smaller steps, as long as that makes the mean of the largest tenth of the string ratios
/// smaller. \param seeds the number of drives for each trial, from the scenario's seed on
int tune_command(scenario what, unsigned seeds);

} // namespace platoon
