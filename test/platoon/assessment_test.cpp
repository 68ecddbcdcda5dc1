// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulation/assessment.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

BOOST_AUTO_TEST_SUITE(assessment)

BOOST_AUTO_TEST_CASE(compares_neighbours_and_with_the_first, *boost::unit_test::tolerance(1e-9)) {
    platoon::assessment judge{4, 15, 5};
    judge.sample({{.x = 100, .a = -2}, {.x = 84, .a = -3}, {.x = 68.5, .a = 1}, {.x = 52.7, .a = 0}});
    BOOST_TEST(judge.result().error[0] == 1);
    BOOST_TEST(judge.result().string_ratio == 1.6); // 0.8 behind 0.5
    BOOST_TEST(judge.result().first_ratio == 1);
    BOOST_TEST(judge.result().acceleration_ratio == 1.5);
    judge.sample({{.x = 100, .a = 4}, {.x = 85, .a = 0}, {.x = 68, .a = 2}, {.x = 53, .a = -5}});
    BOOST_TEST(judge.result().first_ratio == 2);
    BOOST_TEST(judge.result().acceleration_ratio == 1.25);
}

BOOST_AUTO_TEST_CASE(compares_with_nothing_that_is_only_noise) {
    platoon::assessment judge{3, 15, 5};
    judge.sample({{.x = 100, .a = 0.09}, {.x = 84.991, .a = -3}, {.x = 60, .a = 1}});
    BOOST_TEST(std::isnan(judge.result().first_ratio));
    BOOST_TEST(std::isnan(judge.result().acceleration_ratio));
}

BOOST_AUTO_TEST_SUITE_END()
