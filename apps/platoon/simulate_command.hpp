// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "recording.hpp"
#include "simulation.hpp"

#include <string>

namespace platoon {

/// Simulates the scenario with seeds 1 to `seeds`, and prints the result of each.
/// \param record a file for the first of them; empty: none
/// \return 1 if vehicles collided
int simulate_command(scenario what, unsigned seeds, bool json, const std::string& record);

} // namespace platoon
