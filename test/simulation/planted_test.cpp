// SPDX-License-Identifier: BSL-1.0
// The simulation detects what it checks for: for each rule, a fault is planted in the harness, and has to be found
// within few seeds, as a violation of that rule and of no other.
#include "simulation/network/planted.hpp"
#include "simulation/seeds.hpp"
#include "simulation/world/simulate.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <string>

namespace sim = cles::simulation;

namespace planted {
namespace {

/// This fault violates that rule, and no other, in one of few seeds, which passes without the fault.
void finds(sim::planted fault, sim::rule broken) {
    const auto seed = sim::first_to_break(broken, sim::seeds_for_planted, [&](std::uint64_t s) {
        const auto p = sim::make_plan(s, sim::steps_of_a_seed);
        const bool twice = broken == sim::rule::same_trace;
        return (twice ? sim::simulate_twice(p, fault) : sim::simulate(p, fault)).violations;
    });
    BOOST_TEST_REQUIRE(seed != 0U, std::string{to_string(fault)} + " was not found");
    BOOST_TEST(sim::simulate(sim::make_plan(seed, sim::steps_of_a_seed)).violations.empty());
    BOOST_TEST_MESSAGE(std::string{to_string(fault)} + " is found by seed " + std::to_string(seed));
}

} // namespace
} // namespace planted

BOOST_AUTO_TEST_SUITE(planted)

BOOST_AUTO_TEST_CASE(a_stream_that_repeats_a_push) { finds(sim::planted::stream_repeats, sim::rule::effects_once); }
BOOST_AUTO_TEST_CASE(a_copy_from_another_port) { finds(sim::planted::source_swapped, sim::rule::effects_once); }
BOOST_AUTO_TEST_CASE(a_timer_that_is_late) { finds(sim::planted::timer_late, sim::rule::ends_in_time); }
BOOST_AUTO_TEST_CASE(replies_in_another_order) { finds(sim::planted::replies_swapped, sim::rule::reply_order); }
BOOST_AUTO_TEST_CASE(an_update_that_comes_twice) { finds(sim::planted::update_repeated, sim::rule::update_order); }
BOOST_AUTO_TEST_CASE(a_gap_that_is_not_told) { finds(sim::planted::gap_hidden, sim::rule::gaps_told); }
BOOST_AUTO_TEST_CASE(replies_that_bear_each_others_ids) {
    finds(sim::planted::ids_exchanged, sim::rule::replies_match);
}
BOOST_AUTO_TEST_CASE(a_datagram_that_is_too_long) { finds(sim::planted::datagram_long, sim::rule::well_formed); }
BOOST_AUTO_TEST_CASE(a_link_that_is_never_full) { finds(sim::planted::never_full, sim::rule::bounded); }
BOOST_AUTO_TEST_CASE(a_handler_that_is_kept) { finds(sim::planted::call_kept, sim::rule::at_rest); }
BOOST_AUTO_TEST_CASE(a_source_that_is_kept) { finds(sim::planted::source_kept, sim::rule::at_rest); }
BOOST_AUTO_TEST_CASE(a_way_that_stays_closed) { finds(sim::planted::partition_stays, sim::rule::asks_succeed); }
BOOST_AUTO_TEST_CASE(a_feed_that_is_not_bound_again) {
    finds(sim::planted::rebind_forgotten, sim::rule::feeds_receive);
}
BOOST_AUTO_TEST_CASE(a_feed_that_is_bound_again_without_a_pause) {
    finds(sim::planted::rebind_hurried, sim::rule::backs_off);
}
BOOST_AUTO_TEST_CASE(a_name_that_is_not_waited_for) { finds(sim::planted::names_given_up, sim::rule::names_awaited); }
BOOST_AUTO_TEST_CASE(a_node_that_announces_itself_no_more) {
    finds(sim::planted::announcements_end, sim::rule::others_known);
}
BOOST_AUTO_TEST_CASE(a_stop_that_is_not_noticed) { finds(sim::planted::excuse_forgotten, sim::rule::nobody_lost); }
BOOST_AUTO_TEST_CASE(a_farewell_that_nobody_hears) { finds(sim::planted::farewell_unheard, sim::rule::gone_in_time); }
BOOST_AUTO_TEST_CASE(a_clash_that_is_not_told) { finds(sim::planted::clash_kept, sim::rule::clashes_told); }
BOOST_AUTO_TEST_CASE(an_update_that_comes_twice_by_the_group) {
    finds(sim::planted::group_repeated, sim::rule::update_order);
}
BOOST_AUTO_TEST_CASE(a_gap_in_the_group_that_is_not_told) {
    finds(sim::planted::group_gap_hidden, sim::rule::gaps_told);
}
BOOST_AUTO_TEST_CASE(a_lease_that_is_not_renewed) { finds(sim::planted::lease_lapses, sim::rule::feeds_receive); }
BOOST_AUTO_TEST_CASE(an_update_that_is_sent_twice) { finds(sim::planted::group_sends_twice, sim::rule::sent_once); }
BOOST_AUTO_TEST_CASE(a_last_update_that_is_not_repeated) {
    finds(sim::planted::repeat_swallowed, sim::rule::first_soon);
}
BOOST_AUTO_TEST_CASE(a_stream_that_loses_what_is_urgent) { finds(sim::planted::urgent_lost, sim::rule::asks_succeed); }
BOOST_AUTO_TEST_CASE(a_departure_that_loses_answers) { finds(sim::planted::finish_resets, sim::rule::replies_match); }
BOOST_AUTO_TEST_CASE(chance_from_elsewhere) { finds(sim::planted::chance_leaks, sim::rule::same_trace); }

BOOST_AUTO_TEST_SUITE_END()
