// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/planted.hpp"
#include "simulation/world/witness.hpp"
#include "support/amount.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ranges>
#include <string>
#include <vector>

namespace cles::simulation {

inline constexpr bool has_security = CLES_SIMULATION_SECURED != 0;

// How much every test run simulates: with a sanitizer a part, but all planted faults.
using test::amount;
inline constexpr std::uint64_t seeds = amount(3000, 60);
inline constexpr std::uint64_t long_seeds = amount(100, 3);
inline constexpr std::uint64_t secured_seeds = amount(100, 8);
inline constexpr std::uint64_t calm_seeds = amount(12, 2);
inline constexpr std::uint64_t routing_seeds = amount(60, 5);
inline constexpr std::uint64_t seeds_for_planted = amount(400, 150);
inline constexpr unsigned steps_of_a_seed = 300;
inline constexpr unsigned steps_of_a_long_seed = 3000;

inline constexpr unsigned sharing_nodes = amount(200, 16);
inline constexpr unsigned sharing_jobs = amount(100'000, 2'000);
inline constexpr std::uint64_t sharing_seeds = amount(10, 1);
inline constexpr unsigned jobs_of_a_small_mesh = amount(10'000, 2'000);

inline constexpr unsigned mesh_nodes = amount(200, 20);
inline constexpr std::uint64_t mesh_seeds = amount(10, 1);
inline constexpr unsigned cut_mesh_nodes = amount(40, 16);
inline constexpr unsigned cut_mesh_cuts = amount(8, 4);
inline constexpr std::uint64_t cut_mesh_seeds = amount(3, 1);
inline constexpr std::uint64_t undeclared_mesh_seeds = amount(5, 1);
inline constexpr unsigned secured_mesh_nodes = amount(20, 12);
inline constexpr std::uint64_t secured_mesh_seeds = amount(4, 1);

inline constexpr std::size_t gossip_nodes = amount(36, 20); ///< enough that no node asks all others
inline constexpr std::size_t gossip_few_nodes = amount(30, 12);
inline constexpr std::size_t gossip_many_nodes = amount(120, 20);
inline constexpr std::chrono::seconds gossip_rough_time{amount(100, 20)};
inline constexpr std::size_t announced_nodes = amount(300, 120);

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
