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
/// The offset in a period at which vehicle i of n sends, so that not all send at once.
double send_offset(std::size_t i, std::size_t n, double hz);
/// Vehicle i's name, and where it is at time 0.
std::string name_of(std::size_t i);
motion start_position(std::size_t i, double spacing, double speed);

struct scenario {
    std::size_t vehicles = 20;
    double seconds = 0; ///< 0: until five seconds after the manoeuvre
    double loss = 0;    ///< the share of updates that each receiver loses
    double delay = 0;   ///< s, the maximum delay of an update; the minimum is half of it
    std::uint64_t seed = 1;
    std::ptrdiff_t vanish = -1; ///< the vehicle that stops sending at `vanish_at`, and has no driver from then on
    double vanish_at = 0;
    driver_setup setup{}; ///< of each vehicle, without name, position and predecessor
    /// Called when a vehicle changes its mode.
    std::function<void(double now, const std::string& vehicle, role mode, const std::string& why)> on_change{};
};

/// The command of a vehicle without a driver: it keeps braking, and starts to brake if it did not.
double failsafe_command(double last_command);

/// A platoon in virtual time. \param watch is called a hundred times per second with all positions
verdict simulate(const scenario& what, const std::function<void(double now, const std::vector<motion>&)>& watch = {});

} // namespace platoon
