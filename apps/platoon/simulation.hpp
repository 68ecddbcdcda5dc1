// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "assessment.hpp"
#include "driver.hpp"
#include "impairment.hpp"

#include <functional>
#include <vector>

namespace platoon {

/// How often a vehicle decides between two of its updates, so that it does so at least 100 times a second.
unsigned decisions_per_update(double hz);
/// When within a period vehicle i of n has its turn to send, so that not all do at once.
double turn_of(std::size_t i, std::size_t n, double hz);
/// Vehicle i's name, and where it is at time 0.
std::string name_of(std::size_t i);
motion place_of(std::size_t i, double spacing, double speed);

struct scenario {
    std::size_t vehicles = 20;
    double seconds = 0; ///< 0: as long as the manoeuvre takes, and five more
    double loss = 0;    ///< the part of updates that each receiver loses
    double delay = 0;   ///< s, the most that an update takes; at least half of it
    std::uint64_t seed = 1;
    std::ptrdiff_t vanish = -1; ///< who falls silent, at `vanish_at`, and is without a driver
    double vanish_at = 0;
    driver_setup like{}; ///< of each vehicle, but its name, place and whom it follows
    /// Is told when a vehicle changes what it does.
    std::function<void(double now, const std::string& vehicle, role mode, const std::string& why)> on_change{};
};

/// What becomes of a vehicle whose driver is gone: its brakes hold as they were, and apply by themselves where they did
/// not.
double without_driver(double last_command);

/// A platoon in virtual time. \param watch is called a hundred times a second with where everybody is
verdict simulate(const scenario& what, const std::function<void(double now, const std::vector<motion>&)>& watch = {});

} // namespace platoon
