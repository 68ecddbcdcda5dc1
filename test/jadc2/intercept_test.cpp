// SPDX-License-Identifier: BSL-1.0
#include "strike/intercept.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

BOOST_AUTO_TEST_SUITE(intercept)

BOOST_AUTO_TEST_CASE(one_that_stands_is_met_where_it_is) {
    const auto hit = strike::intercept({0, 0}, 10, {30, 40}, {0, 0});
    BOOST_TEST_REQUIRE(hit.has_value());
    BOOST_TEST(hit->after_s == 5);
    BOOST_TEST(hit->where.x == 30);
    BOOST_TEST(hit->where.y == 40);
}

BOOST_AUTO_TEST_CASE(both_are_at_the_same_place_at_the_same_time) {
    for (int heading = 0; heading < 12; ++heading) {
        const strike::place v{8 * std::cos(heading), 8 * std::sin(heading)};
        const auto hit = strike::intercept({-100, 20}, 40, {60, 90}, v);
        BOOST_TEST_REQUIRE(hit.has_value());
        BOOST_TEST(std::abs(hit->where.x - (60 + v.x * hit->after_s)) < 1e-9);
        BOOST_TEST(std::abs(std::hypot(hit->where.x + 100, hit->where.y - 20) - 40 * hit->after_s) < 1e-9);
    }
}

BOOST_AUTO_TEST_CASE(one_that_is_faster_is_met_only_where_it_comes_near) {
    BOOST_TEST(!strike::intercept({0, 0}, 10, {100, 0}, {20, 0}));
    const auto towards = strike::intercept({0, 0}, 10, {100, 0}, {-20, 0});
    BOOST_TEST_REQUIRE(towards.has_value());
    BOOST_TEST(std::abs(towards->after_s - 100.0 / 30) < 1e-9);
}

BOOST_AUTO_TEST_CASE(one_that_is_as_fast) {
    BOOST_TEST(!strike::intercept({0, 0}, 10, {100, 0}, {10, 0}));
    const auto towards = strike::intercept({0, 0}, 10, {100, 0}, {-10, 0});
    BOOST_TEST_REQUIRE(towards.has_value());
    BOOST_TEST(std::abs(towards->after_s - 5) < 1e-9);
}

BOOST_AUTO_TEST_CASE(one_that_is_here_is_met_at_once) {
    const auto hit = strike::intercept({5, 5}, 10, {5, 5}, {3, 0});
    BOOST_TEST_REQUIRE(hit.has_value());
    BOOST_TEST(hit->after_s == 0);
}

BOOST_AUTO_TEST_CASE(from_above_the_way_is_longer) {
    const auto hit = strike::intercept({0, 0}, 10, {30, 40}, {0, 0}, 120);
    BOOST_TEST_REQUIRE(hit.has_value());
    BOOST_TEST(hit->after_s == 13);
    BOOST_TEST(hit->where.x == 30);
}

BOOST_AUTO_TEST_SUITE_END()
