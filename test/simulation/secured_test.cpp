// SPDX-License-Identifier: BSL-1.0
// Nodes with security, whose roster changes while they cannot reach each other, and somebody who forges and repeats
// datagrams.
#include "simulation/network/planted.hpp"
#include "simulation/seeds.hpp"
#include "simulation/world/simulate.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

namespace sim = cles::simulation;

BOOST_AUTO_TEST_SUITE(secured)

namespace {

sim::plan plan_of(std::uint64_t seed) { return sim::make_plan(seed, sim::steps_of_a_seed, true); }

/// This fault violates that rule, and no other, in one of few seeds, which passes without the fault.
void finds(sim::planted fault, sim::rule broken) {
    const auto seed = sim::first_to_break(broken, sim::secured_seeds,
                                          [&](std::uint64_t s) { return sim::simulate(plan_of(s), fault).violations; });
    BOOST_TEST_REQUIRE(seed != 0U, std::string{to_string(fault)} + " was not found");
    BOOST_TEST(sim::simulate(plan_of(seed)).violations.empty());
    BOOST_TEST_MESSAGE(std::string{to_string(fault)} + " is found by seed " + std::to_string(seed));
}

/// The same activity, without faults, and with longer deadlines.
sim::plan calm_plan_of(std::uint64_t seed) {
    using enum sim::deed;
    auto p = sim::make_plan(seed, sim::steps_of_a_seed);
    p.small_limits = false;
    std::erase_if(p.actions, [](const sim::action& a) {
        return a.what != ask && a.what != follow && a.what != publish && a.what != offer && a.what != gather;
    });
    for (auto& a : p.actions) {
        if (a.what == ask) {
            constexpr std::size_t by = 3;
            constexpr std::size_t deadline = 5;
            constexpr std::uint32_t longer_than_any_work = 10'000;
            a.numbers[by] %= 3; // with security, names are known from the start
            a.numbers[deadline] = longer_than_any_work;
        }
    }
    return p;
}

} // namespace

BOOST_AUTO_TEST_CASE(whatever_is_forged_repeated_or_changed_only_members_are_served_and_once) {
    constexpr std::uint64_t twice_every = 16;
    std::uint64_t requests = 0;
    std::uint64_t updates = 0;
    for (std::uint64_t seed = 1; seed <= sim::secured_seeds; ++seed) {
        const auto r = seed % twice_every == 0 ? sim::simulate_twice(plan_of(seed)) : sim::simulate(plan_of(seed));
        for (const auto& v : r.violations) {
            BOOST_ERROR("cles_simulation --secured --seed " << seed << ": " << to_string(v.broken) << ": " << v.what);
        }
        requests += r.requests;
        updates += r.updates;
    }
    BOOST_TEST(requests > sim::secured_seeds * 50); // there was activity
    BOOST_TEST(updates > sim::secured_seeds);
}

BOOST_AUTO_TEST_CASE(while_nothing_goes_wrong_requests_end_as_they_do_without_security) {
    constexpr std::uint64_t enough = sim::is_slow ? 2 : 12;
    for (std::uint64_t seed = 1; seed <= enough; ++seed) {
        auto p = calm_plan_of(seed);
        const auto plain = sim::simulate(p);
        p.secured = true;
        const auto secured = sim::simulate(p);
        BOOST_TEST(plain.outcomes.size() > 30U);
        BOOST_TEST(plain.violations.empty());
        BOOST_TEST(secured.violations.empty());
        BOOST_TEST((plain.outcomes == secured.outcomes), "seed " + std::to_string(seed));
    }
}

BOOST_AUTO_TEST_CASE(a_line_that_nobody_has_sealed) { finds(sim::planted::forgery_taken, sim::rule::authentic); }
BOOST_AUTO_TEST_CASE(a_datagram_that_counts_twice) { finds(sim::planted::replay_taken, sim::rule::authentic); }
BOOST_AUTO_TEST_CASE(a_datagram_of_the_group_that_counts_twice) {
    finds(sim::planted::group_replay_taken, sim::rule::authentic);
}
BOOST_AUTO_TEST_CASE(a_stranger_who_is_admitted) { finds(sim::planted::stranger_admitted, sim::rule::authentic); }
BOOST_AUTO_TEST_CASE(an_update_that_comes_twice) { finds(sim::planted::update_repeated, sim::rule::update_order); }
BOOST_AUTO_TEST_CASE(a_removed_member_who_is_served) {
    finds(sim::planted::removed_served, sim::rule::removed_unserved);
}
BOOST_AUTO_TEST_CASE(rights_that_do_not_count) { finds(sim::planted::rights_ignored, sim::rule::rights_hold); }
BOOST_AUTO_TEST_CASE(a_roster_that_does_not_spread) { finds(sim::planted::roster_withheld, sim::rule::rosters_spread); }
BOOST_AUTO_TEST_CASE(a_roster_that_becomes_older) {
    finds(sim::planted::roster_rolled_back, sim::rule::rosters_advance);
}
BOOST_AUTO_TEST_CASE(a_handshake_that_takes_long) { finds(sim::planted::welcome_late, sim::rule::back_soon); }
BOOST_AUTO_TEST_CASE(a_salt_that_is_used_again) { finds(sim::planted::salt_repeated, sim::rule::nonces_differ); }

BOOST_AUTO_TEST_SUITE_END()
