// SPDX-License-Identifier: BSL-1.0
// A platoon on simulated nodes: the code of the vehicles, and the nodes that they ship with. `scripts/simulate platoon`
// drives more often.
#include "simulation/platoon.hpp"
#include "simulation/seeds.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

BOOST_AUTO_TEST_SUITE(platoon)

using cles::simulation::expect_none;
using cles::simulation::simulate_platoon;

namespace {

::platoon::scenario scenario_with(double loss, double burst) {
    ::platoon::scenario what{.vehicles = 5, .losses = ::platoon::losses_of(loss, burst)};
    what.setup.plan.brake_at = 1;
    what.setup.plan.slow_for = 1;
    return what;
}

} // namespace

BOOST_AUTO_TEST_CASE(without_faults_it_drives_as_the_control_law_alone) {
    const auto what = scenario_with(0, 0);
    const auto driven = simulate_platoon(what);
    expect_none(driven.violations, "without faults");
    const auto alone = simulate(what);
    BOOST_TEST(driven.missed == 0U);
    BOOST_TEST(driven.lost == 0U);
    BOOST_TEST(driven.received > driven.sent * 3 / 2); // followers are bound to the leader and to the one ahead
    BOOST_TEST(driven.drive.verdict.ended);
    BOOST_TEST(std::abs(driven.drive.verdict.string_ratio - alone.string_ratio) < 0.01);
    BOOST_TEST(std::abs(driven.drive.verdict.least_gap - alone.least_gap) < 0.05);
    BOOST_TEST(driven.drive.fallbacks + driven.drive.radar_spells == 0U);
}

BOOST_AUTO_TEST_CASE(what_the_network_loses_nodes_report_as_gaps) {
    const auto driven = simulate_platoon(scenario_with(0.2, 0));
    expect_none(driven.violations, "20 % lost");
    const auto share = [](std::uint64_t part, std::uint64_t all) {
        return static_cast<double>(part) / static_cast<double>(all);
    };
    BOOST_TEST(std::abs(share(driven.lost, driven.copies) - 0.2) < 0.02);
    BOOST_TEST(std::abs(share(driven.missed, driven.received + driven.missed) - 0.2) < 0.03);
    BOOST_TEST(!driven.drive.verdict.collision);
    BOOST_TEST(driven.drive.verdict.string_ratio < 1.02);
}

BOOST_AUTO_TEST_CASE(bursts_are_noticed) {
    const auto driven = simulate_platoon(scenario_with(0.3, 10));
    expect_none(driven.violations, "30 % lost in bursts of 10");
    BOOST_TEST(driven.drive.radar_spells > 0U);
    BOOST_TEST(!driven.drive.verdict.collision);
}

BOOST_AUTO_TEST_CASE(a_seed_is_always_the_same_drive) {
    const auto what = scenario_with(0.1, 3);
    const auto once = simulate_platoon(what);
    const auto again = simulate_platoon(what);
    BOOST_TEST(once.received == again.received);
    BOOST_TEST(once.drive.verdict.least_gap == again.drive.verdict.least_gap);
}

BOOST_AUTO_TEST_SUITE_END()
