// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/world/witness.hpp"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace cles::simulation {

/// How much every test run simulates: less where each step is slow.
inline constexpr bool is_slow = CLES_SIMULATION_IS_SLOW != 0;
inline constexpr bool has_security = CLES_SIMULATION_SECURED != 0;
inline constexpr std::uint64_t seeds = is_slow ? 60 : 3000;
inline constexpr std::uint64_t long_seeds = is_slow ? 3 : 100;
inline constexpr std::uint64_t secured_seeds = is_slow ? 8 : 100;
inline constexpr std::uint64_t seeds_for_planted = is_slow ? 150 : 400;
inline constexpr unsigned steps_of_a_seed = 300;
inline constexpr unsigned steps_of_a_long_seed = 3000;

/// The first seed with which a simulation violates only this rule; 0 if none does.
template <class Simulation>
std::uint64_t first_to_break(rule broken, std::uint64_t count, Simulation violations_of) {
    for (std::uint64_t seed = 1; seed <= count; ++seed) {
        const std::vector<violation> all = violations_of(seed);
        if (!all.empty() && std::all_of(all.begin(), all.end(), [&](const auto& v) { return v.broken == broken; })) {
            return seed;
        }
    }
    return 0;
}

} // namespace cles::simulation
