// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "platoon/drive/recording.hpp"
#include "platoon/driver/driver.hpp"
#include "platoon/simulation/incident.hpp"
#include "platoon/simulation/simulation.hpp"

#include <optional>
#include <string>
#include <vector>

namespace platoon {

struct drive_options {
    std::size_t vehicles = 10;
    double seconds = 0;         ///< 0: until five seconds after the leader's manoeuvre
    double loss = 0, delay = 0; ///< of each packet from one vehicle to another
    double burst = 0;           ///< the mean number of packets of a burst of losses; 0: losses are independent
    spread differences{};
    std::uint64_t seed = 1;
    driver_setup setup{}; ///< of each vehicle, without name, position and predecessor
    std::vector<incident> incidents{};
    cles::multicast_options group{};
    bool insecure = false; ///< allow a group beyond this host, where nodes are not authenticated
    std::string keys{};   ///< the folder of a fleet, with the keys of `operator` and each vehicle in folders of its own
    bool secured = false; ///< with the keys of a fleet that is created for this drive
    bool quiet = false;   ///< show no progress
    bool in_place = false; ///< show a table that changes in place; otherwise a line each second
};

/// Starts each vehicle as a process of its own, watches them drive, and ends them. With faults, each is in a network
/// namespace of its own, behind a relay that loses and delays what they send; what radars see, and the verdict, come by
/// links without faults.
/// \throws cles::error if the group is not available, another platoon uses it, or a vehicle does not start; with faults
/// `no_target` if there can be no network namespaces
recording drive(const drive_options& options);

} // namespace platoon
