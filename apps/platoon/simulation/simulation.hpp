// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/driver.hpp"
#include "platoon/driver/localization.hpp"
#include "platoon/driver/pace.hpp"
#include "platoon/simulation/assessment.hpp"
#include "platoon/simulation/impairment.hpp"
#include "platoon/simulation/incident.hpp"

#include <functional>
#include <string>
#include <vector>

namespace platoon {

/// Vehicle i's name.
std::string name_of(std::size_t i);
/// The losses on a link. \param loss the share \param burst the mean number of updates of a burst; 0: independent
gilbert_elliott losses_of(double loss, double burst);

/// Between which limits the vehicles of a platoon differ, each limit evenly distributed.
struct spread {
    double least_lag = vehicle_limits{}.lag, most_lag = vehicle_limits{}.lag;         ///< s
    double least_brake = vehicle_limits{}.brake, most_brake = vehicle_limits{}.brake; ///< m/s²
};
/// Those of each vehicle, determined by a seed.
std::vector<vehicle_limits> limits_of(std::size_t vehicles, const spread& how, const vehicle_limits& same,
                                      std::uint64_t seed);
/// Where each is at time 0.
std::vector<motion> start_positions(const std::vector<vehicle_limits>& vehicles, double spacing, double speed);

struct scenario {
    std::size_t vehicles = 20;
    double seconds = 0; ///< 0: until five seconds after the manoeuvre
    gilbert_elliott losses{};
    double delay = 0; ///< s, the maximum delay of an update; the minimum is half of it
    std::uint64_t seed = 1;
    std::vector<incident> incidents{};
    spread differences{};
    driver_setup setup{};            ///< of each vehicle, without name, position and predecessor
    std::vector<dialect> dialects{}; ///< what each vehicle tells; those that are missing: everything
    bool leader_known = true;        ///< those behind a vehicle that does not tell its leader know it
    /// Called when a vehicle changes its mode.
    std::function<void(double now, const std::string& vehicle, role mode, const std::string& why)> on_change{};
};

/// What vehicle i tells.
dialect dialect_of(const scenario& what, std::size_t i);
/// The setup of vehicle i, apart from its name and its limits.
driver_setup setup_of(const scenario& what, std::size_t i);

/// A vehicle at a moment of the simulation.
struct sighting {
    motion where{};
    double desired = 0;  ///< distance to the one ahead, front to front, m
    double distance = 0; ///< to the one ahead in the lane; NaN: there is none
    bool in_lane = true;
    role mode = role::follow;
};

/// A platoon in virtual time. \param watch is called a hundred times per second with all vehicles; those that join are
/// added at the end
verdict simulate(const scenario& what, const std::function<void(double now, const std::vector<sighting>&)>& watch = {});

} // namespace platoon
