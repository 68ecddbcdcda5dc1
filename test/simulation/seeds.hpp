// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>

namespace cles::simulation {

/// How much every run of the tests simulates: less where each step is slow.
inline constexpr bool is_slow = CLES_SIMULATION_IS_SLOW != 0;
inline constexpr std::uint64_t seeds = is_slow ? 60 : 3000;
inline constexpr std::uint64_t long_seeds = is_slow ? 3 : 100;
inline constexpr std::uint64_t seeds_for_planted = is_slow ? 150 : 400;
inline constexpr unsigned steps_of_a_seed = 300;
inline constexpr unsigned steps_of_a_long_seed = 3000;

} // namespace cles::simulation
