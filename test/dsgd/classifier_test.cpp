// SPDX-License-Identifier: BSL-1.0
#include "sgd/classifier.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

BOOST_AUTO_TEST_SUITE(classifier)

const sgd::data_set data{sgd::recipe{.per_class = 20'000}};

BOOST_AUTO_TEST_CASE(one_that_knows_nothing_is_wrong_in_half) {
    BOOST_TEST(mean_squared_error(data, {}) == 0.5);
    BOOST_TEST(mean_squared_error(data, {.bias = 0.5}) == 0.25);
    BOOST_TEST(judge(data, {}).wrong == 0.5);
    BOOST_TEST(judge(data, {.bias = 1}).wrong == 0.5);
}

BOOST_AUTO_TEST_CASE(nothing_near_the_best_is_better) {
    const auto best = least_squares(data);
    const auto least = mean_squared_error(data, best);
    for (const double step : {-1e-3, 1e-3}) {
        BOOST_TEST(mean_squared_error(data, {{best.weights[0] + step, best.weights[1]}, best.bias}) > least);
        BOOST_TEST(mean_squared_error(data, {{best.weights[0], best.weights[1] + step}, best.bias}) > least);
        BOOST_TEST(mean_squared_error(data, {best.weights, best.bias + step}) > least);
    }
}

// For two classes with the variance 1, d apart, the minimum error of a line is 1/4 / (1 + d^2/4).
BOOST_AUTO_TEST_CASE(the_best_is_as_good_as_theory_has_it) {
    const auto q = judge(data, least_squares(data));
    BOOST_TEST(q.mse == q.least_mse);
    BOOST_TEST(std::abs(q.least_mse - 0.25 / (1 + 49 / 4.0)) < 3e-4);
    // Half the distance is 3.5 standard deviations; 0.023 % of a normal distribution are beyond that.
    BOOST_TEST(q.wrong > 0);
    BOOST_TEST(q.wrong < 6e-4);
}

BOOST_AUTO_TEST_SUITE_END()
