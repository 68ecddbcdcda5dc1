// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/emergency.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

BOOST_AUTO_TEST_SUITE(emergency)

BOOST_AUTO_TEST_CASE(knows_when_two_touch, *boost::unit_test::tolerance(1e-9)) {
    BOOST_TEST(platoon::time_to_collision({.x = 0, .v = 20, .a = 0}, {.x = 10, .v = 15, .a = 0}) == 2);
    BOOST_TEST(platoon::time_to_collision({.x = 0, .v = 20, .a = 0}, {.x = 8, .v = 20, .a = -4}) == 2);
    BOOST_TEST(std::isinf(platoon::time_to_collision({.x = 0, .v = 15, .a = 0}, {.x = 10, .v = 20, .a = 0})));
    BOOST_TEST(std::isinf(platoon::time_to_collision({.x = 0, .v = 20, .a = -4}, {.x = 10, .v = 19, .a = 0})));
    BOOST_TEST(platoon::time_to_collision({.x = 0, .v = 0, .a = 0}, {.x = -1, .v = 0, .a = 0}) == 0);
}

BOOST_AUTO_TEST_CASE(knows_how_hard_to_brake, *boost::unit_test::tolerance(1e-9)) {
    // 20 m, of which 3 m pass before the brakes act, and 2 m are left.
    BOOST_TEST(platoon::required_deceleration({.x = 0, .v = 10, .a = 0}, {.x = 20, .v = 0, .a = 0}) == 100.0 / 30);
    // Both brake: the one ahead stands first.
    BOOST_TEST(platoon::required_deceleration({.x = 0, .v = 10, .a = -5}, {.x = 7, .v = 10, .a = -5}) ==
               8.5 * 8.5 / (2 * (5 + 8.5 * 8.5 / 10)));
    BOOST_TEST(platoon::required_deceleration({.x = 0, .v = 10, .a = 0}, {.x = 20, .v = 12, .a = 0}) == 0);
}

BOOST_AUTO_TEST_CASE(brakes_only_in_an_emergency, *boost::unit_test::tolerance(1e-9)) {
    // As in any hard braking of a platoon.
    BOOST_TEST(!platoon::emergency_braking({.x = 0, .v = 20, .a = -5.5}, {.x = 9, .v = 20, .a = -6}, 8));
    // Near, but slow enough.
    BOOST_TEST(!platoon::emergency_braking({.x = 0, .v = 1, .a = 0}, {.x = 4, .v = 0.5, .a = 0}, 8));
    const auto hard = platoon::emergency_braking({.x = 0, .v = 20, .a = 0}, {.x = 5, .v = 15, .a = 0}, 8);
    BOOST_TEST_REQUIRE(hard.has_value());
    BOOST_TEST(*hard == 8);
    const auto some = platoon::emergency_braking({.x = 0, .v = 20, .a = 0}, {.x = 8, .v = 15, .a = 0}, 8);
    BOOST_TEST_REQUIRE(some.has_value());
    BOOST_TEST(*some == 1.2 * 25 / (2 * 4.5)); // 8 m, less 1.5 m and 2 m
    const auto touched = platoon::emergency_braking({.x = 0, .v = 1, .a = 0}, {.x = -0.1, .v = 1, .a = 0}, 5.5);
    BOOST_TEST_REQUIRE(touched.has_value());
    BOOST_TEST(*touched == 5.5);
}

BOOST_AUTO_TEST_SUITE_END()
