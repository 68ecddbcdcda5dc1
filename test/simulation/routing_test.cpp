// SPDX-License-Identifier: BSL-1.0
// A node that routes for a client, and workers, all of which crash, are suspended and lose their links, in virtual
// time.
#include "simulation/cluster.hpp"
#include "simulation/seeds.hpp"

#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>

BOOST_AUTO_TEST_SUITE(routing)

using namespace std::chrono_literals;
using namespace cles::simulation;

namespace {

constexpr std::uint64_t lives = routing_seeds;
constexpr auto trouble = 60s;

/// What became of the requests in all runs, which violate nothing.
struct sum {
    std::size_t succeeded = 0;
    std::size_t failed = 0;
    std::size_t refused = 0; ///< of those that failed
    std::size_t moved = 0;
};
sum live_often(bool sharing) {
    sum all;
    for (std::uint64_t seed = 1; seed <= lives; ++seed) {
        auto r = simulate_cluster(seed, trouble, planted::none, sharing);
        expect_none(r.violations, "seed " + std::to_string(seed));
        all.succeeded += r.jobs.succeeded;
        all.failed += r.jobs.failed_in_all();
        all.refused += r.jobs.failed["busy"];
        all.moved += r.moved;
    }
    BOOST_TEST_MESSAGE(all.succeeded << " succeeded, " << all.failed << " failed, " << all.refused
                                     << " of them refused, " << all.moved << " jobs moved");
    BOOST_TEST(all.succeeded > all.failed); // most, despite continuous faults
    return all;
}

} // namespace

BOOST_AUTO_TEST_CASE(whatever_happens_each_request_ends_once_in_its_time_and_none_runs_twice_that_must_not) {
    const auto all = live_often(false);
    BOOST_TEST(all.failed > all.refused);
    BOOST_TEST(all.refused > 0U); // queues were full
}

BOOST_AUTO_TEST_CASE(the_same_holds_for_workers_that_share_their_jobs) {
    BOOST_TEST(live_often(true).moved > 10 * lives);
}

BOOST_AUTO_TEST_CASE(each_planted_fault_is_found) {
    constexpr std::array<planted_case, 6> faults{{
        {planted::way_repeats, rule::effects_once, rule::replies_match},
        {planted::timer_late, rule::ends_in_time},
        {planted::queue_boundless, rule::bounded},
        {planted::stuck_unnoticed, rule::bounded},
        {planted::announcements_end, rule::others_known},
        {planted::call_kept, rule::at_rest},
    }};
    expect_found(faults, 10,
                 [](std::uint64_t seed, planted fault) { return simulate_cluster(seed, trouble, fault).violations; });
}

BOOST_AUTO_TEST_SUITE_END()
