// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/simulation/assessment.hpp"
#include "platoon/simulation/simulation.hpp"

#include <boost/describe/class.hpp>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace platoon {

/// The results of all seeds.
struct outcome {
    std::size_t vehicles = 0;
    double hz = 0, loss = 0, burst = 0, delay_ms = 0;
    std::string controller{};
    bool radar = false;
    std::uint64_t first_seed = 0, seeds = 0;
    double string_ratio = 0;                                    ///< the largest
    double stable_ratio = platoon::stable_ratio;                ///< above it, a drive counts as unstable
    std::uint64_t unstable = 0;                                 ///< drives, with those in `broken`
    std::uint64_t broken = 0;                                   ///< drives at whose end vehicles stand or are apart
    bool ended = true;                                          ///< the manoeuvre, in each drive
    double failure_rate = 0, failure_low = 0, failure_high = 0; ///< of string stability, with its 95 % interval
    double first_ratio = NAN;                                   ///< the largest error over that behind the leader
    double above_first_rate = 0, above_first_low = 0,
           above_first_high = 0;     ///< of drives in which it is above `stable_ratio`
    double acceleration_ratio = NAN; ///< the largest
    std::uint64_t collisions = 0;    ///< drives
    double collision_low = 0, collision_high = 0;
    double least_gap = INFINITY;
    double least_time_to_collision = NAN;        ///< s; null: nobody ever came nearer
    amplification braking{}, recovery{}, sine{}; ///< the largest of each vehicle
    bool collision = false;
    double fallbacks = 0;    ///< of one drive, on average
    double radar_spells = 0; ///< how often a vehicle followed by its radar alone, in one drive, on average
    std::vector<verdict> runs{};
};
BOOST_DESCRIBE_STRUCT(outcome, (),
                      (vehicles, hz, loss, burst, delay_ms, controller, radar, first_seed, seeds, string_ratio,
                       stable_ratio, unstable, broken, ended, failure_rate, failure_low, failure_high, first_ratio,
                       above_first_rate, above_first_low, above_first_high, acceleration_ratio, collisions,
                       collision_low, collision_high, least_gap, least_time_to_collision, braking, recovery, sine,
                       collision, fallbacks, radar_spells, runs))

/// The result of one drive.
struct drive_result {
    struct verdict verdict {};
    bool steady = true;             ///< nothing was planned to happen to a vehicle
    std::uint64_t fallbacks = 0;    ///< how often a vehicle fell back because updates were missing
    std::uint64_t radar_spells = 0; ///< how often one followed by its radar alone because updates were missing
};

/// Whether string stability was lost: errors grew, or, while the platoon stayed the same, vehicles stand or are apart.
bool is_failure(const verdict& result, bool steady);
/// The exit code of a drive: 1 for a collision, and if vehicles stand or are apart although nothing was planned to
/// happen to them; 4 if the manoeuvre did not end, so that there is no verdict; otherwise 0.
int exit_code_of(const verdict& result, bool steady);
/// What gains there are, in one line; empty: there are none.
std::string gains_line(const char* heading, const amplification& gains_of_each);

/// No drive yet.
outcome outcome_of(const scenario& what);
void add(outcome& to, const drive_result& drive);
/// The result of a drive in one line.
std::string line_of(std::uint64_t seed, const drive_result& drive);
/// A few lines of text.
std::string summary_of(const outcome& all);
/// As of a drive, for all of them.
int exit_code_of(const outcome& all);

} // namespace platoon
