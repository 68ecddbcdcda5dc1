// SPDX-License-Identifier: BSL-1.0
#include "dsgd/verdict.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(verdict)

BOOST_AUTO_TEST_CASE(one_percent_more_than_the_least_error_is_good) {
    BOOST_TEST(dsgd::shortcoming({.mse = 0.0189, .least_mse = 0.0189}).empty());
    BOOST_TEST(dsgd::shortcoming({.mse = 0.0101, .least_mse = 0.01}).empty());
    BOOST_TEST(dsgd::shortcoming({.mse = 0.0102, .least_mse = 0.01})
                   .starts_with("the result is not good: its error is 1.02 times the best possible. "));
}

BOOST_AUTO_TEST_CASE(worse_than_a_constant_is_told) {
    BOOST_TEST(
        dsgd::shortcoming({.mse = 0.397, .least_mse = 0.0189})
            .starts_with("the result is not good: its error is 21.01 times the best possible, and a constant does "
                         "better. "));
}

BOOST_AUTO_TEST_SUITE_END()
