// SPDX-License-Identifier: BSL-1.0
// Two hundred nodes that share a hundred thousand jobs, in virtual time: none runs twice, and the fate of each is
// known.
#include "simulation/seeds.hpp"
#include "simulation/sharing.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(large_sharing)

using namespace cles::simulation;

BOOST_AUTO_TEST_CASE(two_hundred_nodes_run_each_of_a_hundred_thousand_jobs_once_at_most) {
    const auto r = simulate_sharing(1, {.nodes = sharing_nodes, .jobs = sharing_jobs});
    expect_none(r.violations, "seed 1");
    BOOST_TEST_MESSAGE(to_text(r));
    BOOST_TEST(r.moved > r.jobs.asked / 20);
    BOOST_TEST(r.jobs.succeeded > r.jobs.asked / 2);
}

BOOST_AUTO_TEST_SUITE_END()
