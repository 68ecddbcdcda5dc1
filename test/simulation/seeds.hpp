// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/planted.hpp"
#include "simulation/world/witness.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstdint>
#include <ranges>
#include <string>
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

/// Reports each violation as a failure of the test.
inline void expect_none(const std::vector<violation>& all, const std::string& run) {
    for (const auto& v : all) {
        BOOST_ERROR(run << ": " << to_string(v.broken) << ": " << v.what);
    }
}

/// A planted fault, the rule that it violates, and one that it may violate too.
struct planted_case {
    planted fault;
    rule broken;
    rule also = broken;
};

/// Each fault violates its rule, and no other, with one of the first seeds, which passes without the fault.
/// \param violations_of of the simulation with a seed and a fault
template <class Cases, class Simulation>
void expect_found(const Cases& cases, std::uint64_t count, Simulation violations_of) {
    for (const planted_case& each : cases) {
        const auto shows = [&](std::uint64_t seed) {
            const std::vector<violation> all = violations_of(seed, each.fault);
            return std::ranges::any_of(all, [&](const auto& v) { return v.broken == each.broken; }) &&
                   std::ranges::all_of(all,
                                       [&](const auto& v) { return v.broken == each.broken || v.broken == each.also; });
        };
        const std::string name{to_string(each.fault)};
        const auto all = std::views::iota(std::uint64_t{1}, count + 1);
        const auto found = std::ranges::find_if(all, shows);
        BOOST_TEST((found != all.end()), name + " was not found");
        if (found == all.end()) {
            expect_none(violations_of(1, each.fault), "seed 1 with " + name);
        } else {
            BOOST_TEST_MESSAGE(name + " is found by seed " + std::to_string(*found));
            expect_none(violations_of(*found, planted::none), "seed " + std::to_string(*found) + " without " + name);
        }
    }
}

} // namespace cles::simulation
