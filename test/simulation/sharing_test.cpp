// SPDX-License-Identifier: BSL-1.0
// Nodes that share their jobs, in virtual time: none runs twice, and the fate of each is known, whatever happens.
#include "simulation/seeds.hpp"
#include "simulation/sharing.hpp"

#include <boost/test/unit_test.hpp>

#include <array>
#include <cstdint>
#include <string>

BOOST_AUTO_TEST_SUITE(sharing)

using namespace cles::simulation;

namespace {

work_report hold(std::uint64_t seed, const sharing_setup& setup) {
    auto r = simulate_sharing(seed, setup);
    expect_none(r.violations, "seed " + std::to_string(seed));
    BOOST_TEST_MESSAGE("seed " << seed << ": " << to_text(r));
    return r;
}

constexpr sharing_setup small{.nodes = 20, .clients = 20, .jobs = jobs_of_a_small_mesh, .faults_per_minute = 24};

} // namespace

BOOST_AUTO_TEST_CASE(small_meshes) {
    for (std::uint64_t seed = 1; seed <= sharing_seeds; ++seed) {
        BOOST_TEST(hold(seed, small).moved > 100U);
    }
}

BOOST_AUTO_TEST_CASE(each_planted_fault_is_found) {
    constexpr std::array<planted_case, 3> faults{{
        {planted::moved_run_again, rule::effects_once},
        {planted::moved_twice, rule::effects_once},
        {planted::slots_overstated, rule::bounded},
    }};
    expect_found(faults, 5,
                 [](std::uint64_t seed, planted fault) { return simulate_sharing(seed, small, fault).violations; });
}

BOOST_AUTO_TEST_SUITE_END()
