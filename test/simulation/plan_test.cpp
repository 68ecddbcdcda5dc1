// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/plan.hpp"
#include "simulation/world/simulate.hpp"

#include <boost/test/unit_test.hpp>

#include <stdexcept>
#include <string>

namespace sim = cles::simulation;

BOOST_AUTO_TEST_SUITE(plan)

BOOST_AUTO_TEST_CASE(a_seed_always_makes_the_same_plan) {
    BOOST_TEST((sim::make_plan(7, 200) == sim::make_plan(7, 200)));
    BOOST_TEST((sim::make_plan(7, 200).actions != sim::make_plan(8, 200).actions));
}

BOOST_AUTO_TEST_CASE(a_plan_is_read_back_as_it_was_written) {
    const auto p = sim::make_plan(11, 300);
    BOOST_TEST((sim::plan_from(sim::to_text(p)) == p));
}

BOOST_AUTO_TEST_CASE(comments_are_left_out_and_missing_numbers_are_zero) {
    const auto p = sim::plan_from("# why\nseed 3\nhosts 2\n\n120 cut host=1\n");
    BOOST_TEST(p.seed == 3U);
    BOOST_TEST(p.hosts == 2U);
    BOOST_REQUIRE(p.actions.size() == 1U);
    BOOST_TEST(p.actions[0].at_ms == 120U);
    BOOST_TEST(p.actions[0]["host"] == 1U);
    BOOST_TEST(p.actions[0]["which"] == 0U);
}

BOOST_AUTO_TEST_CASE(what_is_no_plan_is_refused_with_the_line) {
    const auto says = [](const std::string& text, const std::string& part) {
        try {
            sim::plan_from(text);
        } catch (const std::runtime_error& e) {
            return std::string{e.what()}.find(part) != std::string::npos;
        }
        return false;
    };
    BOOST_TEST(says("12 dance\n", "'12 dance': 'dance' is nothing that happens"));
    BOOST_TEST(says("soon cut host=1\n", "'soon' is no number"));
    BOOST_TEST(says("12 cut noun=1\n", "says nothing about cut"));
}

BOOST_AUTO_TEST_CASE(a_plan_that_fails_is_made_smaller_and_still_fails) {
    constexpr auto fault = sim::planted::gap_hidden;
    for (std::uint64_t seed = 1; seed != 100; ++seed) {
        const auto whole = sim::make_plan(seed, 150);
        if (!sim::simulate(whole, fault).broke(sim::rule::gaps_told)) {
            continue;
        }
        const auto small = sim::minimise(whole, sim::rule::gaps_told, fault, 600);
        BOOST_TEST(small.actions.size() <= 8U);
        BOOST_TEST(sim::simulate(small, fault).broke(sim::rule::gaps_told));
        BOOST_TEST(sim::simulate(small).violations.empty());
        return;
    }
    BOOST_FAIL("no seed showed the planted fault");
}

BOOST_AUTO_TEST_SUITE_END()
