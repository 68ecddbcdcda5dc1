// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulation/assessment.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <numbers>
#include <vector>

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

BOOST_AUTO_TEST_CASE(does_not_divide_by_an_error_that_is_none, *boost::unit_test::tolerance(1e-9)) {
    platoon::assessment judge{4, 15, 5};
    judge.sample({{.x = 100}, {.x = 84.99}, {.x = 69.94}, {.x = 54.87}});
    BOOST_TEST(judge.result().error[2] > 6 * judge.result().error[0]);
    BOOST_TEST(judge.result().string_ratio == 0);
    judge.sample({{.x = 100}, {.x = 84.99}, {.x = 69.94}, {.x = 54.74}});
    BOOST_TEST(judge.result().string_ratio == 2); // 0.2 m, behind less than 0.1 m
}

BOOST_AUTO_TEST_CASE(tells_the_gains_of_both_halves, *boost::unit_test::tolerance(1e-9)) {
    platoon::assessment judge{3, 15, 5};
    judge.sample({{.x = 100, .v = 25, .a = -2}, {.x = 84.5, .v = 25, .a = -3}, {.x = 69.7, .v = 25, .a = -4.5}});
    judge.sample({{.x = 100, .v = 15, .a = 0}, {.x = 85, .v = 13, .a = 0}, {.x = 70, .v = 15.4, .a = 0}});
    judge.begin_recovery();
    judge.sample({{.x = 200, .v = 15, .a = 1}, {.x = 184.8, .v = 13, .a = 1.5}, {.x = 170, .v = 15.4, .a = 1.5}});
    judge.sample({{.x = 200, .v = 25, .a = 1}, {.x = 185, .v = 25, .a = 0}, {.x = 169.5, .v = 25, .a = 3}});
    const auto found = judge.result();
    BOOST_TEST_REQUIRE(found.braking.error.size() == 1U);
    BOOST_TEST_REQUIRE(found.braking.speed.size() == 2U);
    BOOST_TEST(found.braking.error[0] == 0.4); // 0.2 m behind 0.5 m
    BOOST_TEST(found.braking.speed[0] == 1.2);
    BOOST_TEST(found.braking.speed[1] == 0.8);
    BOOST_TEST(found.braking.acceleration[0] == 1.5);
    BOOST_TEST(found.braking.acceleration[1] == 1.5);
    BOOST_TEST(found.recovery.error[0] == 2.5);
    BOOST_TEST(found.recovery.speed[0] == 1.2);
    BOOST_TEST(found.recovery.acceleration[0] == 1.5);
    BOOST_TEST(found.recovery.acceleration[1] == 2);
    BOOST_TEST(platoon::largest(found.recovery.acceleration) == 2);
    BOOST_TEST(std::isnan(platoon::largest({})));
}

BOOST_AUTO_TEST_CASE(knows_whether_one_stands_or_is_far_behind) {
    platoon::assessment judge{3, 15, 5};
    judge.sample({{.x = 100, .v = 25}, {.x = 30, .v = 0}, {.x = 15, .v = 0}});
    BOOST_TEST(judge.result().stands);
    BOOST_TEST(judge.result().apart);
    judge.sample({{.x = 100, .v = 25}, {.x = 60, .v = 20}, {.x = 45, .v = 20}}); // only the end counts
    BOOST_TEST(!judge.result().stands);
    BOOST_TEST(!judge.result().apart);
}

BOOST_AUTO_TEST_CASE(measures_the_time_to_a_collision, *boost::unit_test::tolerance(1e-9)) {
    platoon::assessment judge{2, 15, 5};
    judge.sample({{.x = 100, .v = 20}, {.x = 85, .v = 19}});
    BOOST_TEST(std::isnan(judge.result().least_time_to_collision));
    judge.sample({{.x = 100, .v = 20}, {.x = 85, .v = 22}});
    judge.sample({{.x = 100, .v = 20}, {.x = 85, .v = 21}});
    BOOST_TEST(judge.result().least_time_to_collision == 5);
}

BOOST_AUTO_TEST_CASE(measures_amplitudes_at_the_frequency_of_a_sine) {
    platoon::assessment judge{3, 15, 5};
    const std::vector<double> desired(3, 15);
    for (int i = 0; i < 400; ++i) {
        const double phase = i * 0.02 * std::numbers::pi; // four periods
        const double first = std::sin(phase);
        const double second = 2 * std::sin(phase - 1);
        judge.correlate(phase,
                        {{.x = 100, .v = 20 + first, .a = first},
                         {.x = 85 + 0.5 * first, .v = 20 + second, .a = second},
                         {.x = 70 + 0.5 * first + second, .v = 20, .a = 3 * first}},
                        desired);
    }
    const auto found = judge.result().sine;
    BOOST_TEST_REQUIRE(found.error.size() == 1U);
    BOOST_TEST(std::abs(found.error[0] - 4) < 1e-9);
    BOOST_TEST(std::abs(found.speed[0] - 2) < 1e-9);
    BOOST_TEST(std::isnan(found.speed[1]));
    BOOST_TEST(std::abs(found.acceleration[1] - 1.5) < 1e-9);
}

BOOST_AUTO_TEST_SUITE_END()
