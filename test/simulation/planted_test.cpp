// SPDX-License-Identifier: BSL-1.0
// The simulation detects what it checks for: for each rule, a fault is planted in the harness, and has to be found
// within few seeds, as a violation of that rule and of no other.
#include "simulation/seeds.hpp"
#include "simulation/world/simulate.hpp"
#include "support/test_suite.hpp"

#include <boost/test/unit_test.hpp>

#include <array>
#include <cstdint>

namespace sim = cles::simulation;

CLES_TEST_SUITE(planted)

BOOST_AUTO_TEST_CASE(each_fault_is_found) {
    using enum sim::planted;
    using sim::rule;
    constexpr std::array<sim::planted_case, 27> faults{{
        {stream_repeats, rule::effects_once},
        {source_swapped, rule::effects_once},
        {timer_late, rule::ends_in_time},
        {replies_swapped, rule::reply_order},
        {update_repeated, rule::update_order},
        {gap_hidden, rule::gaps_told},
        {ids_exchanged, rule::replies_match},
        {datagram_long, rule::well_formed},
        {never_full, rule::bounded},
        {call_kept, rule::at_rest},
        {source_kept, rule::at_rest},
        {partition_stays, rule::asks_succeed},
        {rebind_forgotten, rule::feeds_receive},
        {rebind_hurried, rule::backs_off},
        {names_given_up, rule::names_awaited},
        {announcements_end, rule::others_known},
        {excuse_forgotten, rule::nobody_lost},
        {farewell_unheard, rule::gone_in_time},
        {clash_kept, rule::clashes_told},
        {group_repeated, rule::update_order},
        {group_gap_hidden, rule::gaps_told},
        {lease_lapses, rule::feeds_receive},
        {group_sends_twice, rule::sent_once},
        {repeat_swallowed, rule::first_soon},
        {urgent_lost, rule::asks_succeed},
        {finish_resets, rule::replies_match},
        {chance_leaks, rule::same_trace},
    }};
    sim::expect_found(faults, sim::seeds_for_planted, [](std::uint64_t seed, sim::planted fault) {
        const auto p = sim::make_plan(seed, sim::steps_of_a_seed);
        return (fault == chance_leaks ? sim::simulate_twice(p, fault) : sim::simulate(p, fault)).violations;
    });
}

BOOST_AUTO_TEST_SUITE_END()
