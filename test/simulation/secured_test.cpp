// SPDX-License-Identifier: BSL-1.0
// Nodes with security, whose roster changes while they cannot reach each other, and somebody who forges and repeats
// datagrams.
#include "simulation/seeds.hpp"
#include "simulation/world/simulate.hpp"

#include <boost/test/unit_test.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace sim = cles::simulation;

BOOST_AUTO_TEST_SUITE(secured)

namespace {

sim::plan plan_of(std::uint64_t seed) { return sim::make_plan(seed, sim::steps_of_a_seed, true); }

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
        expect_none(r.violations, "cles_simulation --secured --seed " + std::to_string(seed));
        requests += r.requests;
        updates += r.updates;
    }
    BOOST_TEST(requests > sim::secured_seeds * 50); // there was activity
    BOOST_TEST(updates > sim::secured_seeds);
}

BOOST_AUTO_TEST_CASE(while_nothing_goes_wrong_requests_end_as_they_do_without_security) {
    for (std::uint64_t seed = 1; seed <= sim::calm_seeds; ++seed) {
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

BOOST_AUTO_TEST_CASE(each_planted_fault_is_found) {
    using enum sim::planted;
    using sim::rule;
    constexpr std::array<sim::planted_case, 11> faults{{
        {forgery_taken, rule::authentic},
        {replay_taken, rule::authentic},
        {group_replay_taken, rule::authentic},
        {stranger_admitted, rule::authentic},
        {update_repeated, rule::update_order},
        {removed_served, rule::removed_unserved},
        {rights_ignored, rule::rights_hold},
        {roster_withheld, rule::rosters_spread},
        {roster_rolled_back, rule::rosters_advance},
        {welcome_late, rule::back_soon},
        {salt_repeated, rule::nonces_differ},
    }};
    sim::expect_found(faults, sim::secured_seeds, [](std::uint64_t seed, sim::planted fault) {
        return sim::simulate(plan_of(seed), fault).violations;
    });
}

BOOST_AUTO_TEST_SUITE_END()
