// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/simulation/outcome.hpp"
#include "platoon/simulation/simulation.hpp"
#include "simulation/world/witness.hpp"

#include <cstdint>
#include <vector>

namespace cles::simulation {

/// The result of a drive on simulated nodes.
struct platoon_report {
    std::vector<violation> violations;
    platoon::drive_result drive;
    std::uint64_t sent = 0, received = 0; ///< updates, by vehicles that were bound
    std::uint64_t missed = 0;             ///< updates that nodes reported as gaps
    std::uint64_t datagrams = 0;          ///< that nodes sent
    std::uint64_t copies = 0, lost = 0;   ///< of those, for one vehicle each, and how many the network lost
};

/// Drives a platoon in virtual time, each vehicle on a node: the classes that `cles-platoon run` drives with, on the
/// library's own nodes in a simulated multicast group. What nodes send is lost and delayed as the scenario says, on
/// each link from one vehicle to another; what radars see, and the verdict, are the true positions. \pre it has no
/// incidents
platoon_report simulate_platoon(const platoon::scenario& what);

} // namespace cles::simulation
