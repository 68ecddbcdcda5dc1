// SPDX-License-Identifier: BSL-1.0
// A node that routes for a client, and workers, all of which crash, are suspended and lose their links, in virtual
// time.
#include "simulation/cluster.hpp"
#include "simulation/seeds.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <string>

BOOST_AUTO_TEST_SUITE(routing)

using namespace std::chrono_literals;
using namespace cles::simulation;

namespace {

constexpr std::uint64_t lives = CLES_SIMULATION_IS_SLOW ? 5 : 60;
constexpr auto trouble = 60s;

/// This fault violates that rule, and no other, in one of a few runs.
void finds(planted fault, rule broken) {
    const auto seed =
        first_to_break(broken, 10, [&](std::uint64_t s) { return simulate_cluster(s, trouble, fault).violations; });
    BOOST_TEST(seed != 0U, std::string{to_string(fault)} + " was not found");
    BOOST_TEST_MESSAGE(std::string{to_string(fault)} + " is found by seed " + std::to_string(seed));
}

} // namespace

BOOST_AUTO_TEST_CASE(whatever_happens_each_request_ends_once_in_its_time_and_none_runs_twice_that_must_not) {
    std::size_t succeeded = 0;
    std::size_t failed = 0;
    std::size_t refused = 0;
    for (std::uint64_t seed = 1; seed <= lives; ++seed) {
        const auto r = simulate_cluster(seed, trouble);
        for (const auto& v : r.violations) {
            BOOST_ERROR("seed " << seed << ": " << to_string(v.broken) << ": " << v.what);
        }
        succeeded += r.succeeded;
        failed += r.failed;
        refused += r.refused;
    }
    BOOST_TEST_MESSAGE(std::to_string(succeeded) + " succeeded, " + std::to_string(failed) + " failed, " +
                       std::to_string(refused) + " of them refused");
    BOOST_TEST(succeeded > failed); // most, despite continuous faults
    BOOST_TEST(failed > refused);
    BOOST_TEST(refused > 0U); // queues were full
}

BOOST_AUTO_TEST_CASE(the_same_holds_for_workers_that_share_their_jobs) {
    std::size_t succeeded = 0;
    std::size_t failed = 0;
    std::size_t moved = 0;
    for (std::uint64_t seed = 1; seed <= lives; ++seed) {
        const auto r = simulate_cluster(seed, trouble, planted::none, true);
        for (const auto& v : r.violations) {
            BOOST_ERROR("seed " << seed << ": " << to_string(v.broken) << ": " << v.what);
        }
        succeeded += r.succeeded;
        failed += r.failed;
        moved += r.moved;
    }
    BOOST_TEST_MESSAGE(std::to_string(succeeded) + " succeeded, " + std::to_string(failed) + " failed, " +
                       std::to_string(moved) + " jobs moved");
    BOOST_TEST(succeeded > failed);
    BOOST_TEST(moved > 10 * lives);
}

BOOST_AUTO_TEST_CASE(a_way_that_repeats_requests_is_found) { finds(planted::way_repeats, rule::effects_once); }
BOOST_AUTO_TEST_CASE(a_timer_that_is_late_is_found) { finds(planted::timer_late, rule::ends_in_time); }
BOOST_AUTO_TEST_CASE(a_queue_without_bounds_is_found) { finds(planted::queue_boundless, rule::bounded); }
BOOST_AUTO_TEST_CASE(a_stuck_worker_of_whom_nobody_knows_is_found) { finds(planted::stuck_unnoticed, rule::bounded); }
BOOST_AUTO_TEST_CASE(a_worker_that_announces_itself_no_more_is_found) {
    finds(planted::announcements_end, rule::others_known);
}
BOOST_AUTO_TEST_CASE(a_handler_that_is_kept_is_found) { finds(planted::call_kept, rule::at_rest); }

BOOST_AUTO_TEST_SUITE_END()
