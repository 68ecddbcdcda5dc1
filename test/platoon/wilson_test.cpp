// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulation/wilson.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

BOOST_AUTO_TEST_SUITE(wilson)

// The limits are the rates from which the observed one is 1.96 standard deviations away: the definition of the
// interval.
BOOST_AUTO_TEST_CASE(its_limits_are_two_deviations_away) {
    for (const auto& [failures, trials] : {std::pair{1, 10}, {3, 1000}, {500, 1000}, {999, 1000}}) {
        const auto found =
            platoon::wilson_interval(static_cast<std::uint64_t>(failures), static_cast<std::uint64_t>(trials));
        const double rate = static_cast<double>(failures) / trials;
        for (const double limit : {found.low, found.high}) {
            BOOST_TEST(std::abs(std::abs(rate - limit) / std::sqrt(limit * (1 - limit) / trials) - 1.959964) < 1e-5);
        }
        BOOST_TEST((found.low < rate && rate < found.high));
    }
}

BOOST_AUTO_TEST_CASE(none_of_many_is_not_certainly_never) {
    const auto none = platoon::wilson_interval(0, 1000);
    BOOST_TEST(none.low == 0);
    BOOST_TEST(std::abs(none.high - 0.003827) < 1e-6); // z² / (n + z²)
    const auto all = platoon::wilson_interval(20, 20);
    BOOST_TEST(all.high == 1);
    BOOST_TEST(std::abs(all.low - 0.838876) < 1e-5);
    BOOST_TEST(platoon::wilson_interval(0, 0).high == 1);
}

BOOST_AUTO_TEST_SUITE_END()
