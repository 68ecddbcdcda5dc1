// SPDX-License-Identifier: BSL-1.0
// Nodes that share their jobs, in virtual time: none runs twice, and the fate of each is known, whatever happens.
#include "simulation/seeds.hpp"
#include "simulation/sharing.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <string>

BOOST_AUTO_TEST_SUITE(sharing)

using namespace cles::simulation;

namespace {

sharing_report hold(std::uint64_t seed, const sharing_setup& setup) {
    auto r = simulate_sharing(seed, setup);
    for (const auto& v : r.violations) {
        BOOST_ERROR("seed " << seed << ": " << to_string(v.broken) << ": " << v.what);
    }
    std::string failed;
    for (const auto& [code, count] : r.failed) {
        failed += ", " + std::to_string(count) + " " + code;
    }
    BOOST_TEST_MESSAGE("seed " << seed << ": " << r.jobs << " jobs, " << r.succeeded << " succeeded" << failed << "; "
                               << r.moved << " moved, " << r.returned << " returned, " << r.faults << " faults in "
                               << r.seconds << " s");
    return r;
}

constexpr sharing_setup small{.nodes = 20, .clients = 20, .jobs = 10'000, .faults_per_minute = 24};

/// A small mesh with this fault violates that rule, and no other, in one of a few runs.
void finds(planted fault, rule broken) {
    const auto seed =
        first_to_break(broken, 5, [&](std::uint64_t s) { return simulate_sharing(s, small, fault).violations; });
    BOOST_TEST(seed != 0U, std::string{to_string(fault)} + " was not found");
    BOOST_TEST_MESSAGE(std::string{to_string(fault)} + " is found by seed " + std::to_string(seed));
}

} // namespace

BOOST_AUTO_TEST_CASE(two_hundred_nodes_run_each_of_a_hundred_thousand_jobs_once_at_most) {
    const auto r = hold(1, {.nodes = is_slow ? 60U : 200U, .jobs = is_slow ? 10'000U : 100'000U});
    BOOST_TEST(r.moved > r.jobs / 20);
    BOOST_TEST(r.succeeded > r.jobs / 2);
}

BOOST_AUTO_TEST_CASE(small_meshes) {
    for (std::uint64_t seed = 1; seed <= (is_slow ? 2 : 10); ++seed) {
        BOOST_TEST(hold(seed, small).moved > 100U);
    }
}

BOOST_AUTO_TEST_CASE(a_pool_that_runs_what_it_has_given_away_is_found) {
    finds(planted::moved_run_again, rule::effects_once);
}
BOOST_AUTO_TEST_CASE(a_node_that_moves_a_job_twice_is_found) { finds(planted::moved_twice, rule::effects_once); }
BOOST_AUTO_TEST_CASE(a_pool_that_takes_jobs_without_free_workers_is_found) {
    finds(planted::slots_overstated, rule::bounded);
}

BOOST_AUTO_TEST_SUITE_END()
