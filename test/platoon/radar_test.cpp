// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/radar.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

BOOST_AUTO_TEST_SUITE(radar)

BOOST_AUTO_TEST_CASE(its_noise_has_the_mean_and_the_deviation_of_its_setup) {
    const platoon::radar_setup setup{.range_noise = 0.1, .rate_noise = 0.03};
    platoon::radar sensor{setup, 3};
    constexpr int echoes = 100'000;
    double sum = 0;
    double squares = 0;
    double rates = 0;
    double rate_squares = 0;
    int outside = 0; // of two deviations
    for (int i = 0; i < echoes; ++i) {
        const auto seen = sensor.measure({.range = 20, .rate = -1});
        BOOST_TEST_REQUIRE(seen.has_value());
        sum += seen->range - 20;
        squares += std::pow(seen->range - 20, 2);
        rates += seen->rate + 1;
        rate_squares += std::pow(seen->rate + 1, 2);
        outside += std::abs(seen->range - 20) > 0.2 ? 1 : 0;
    }
    BOOST_TEST(std::abs(sum / echoes) < 0.0015);
    BOOST_TEST(std::abs(std::sqrt(squares / echoes) - 0.1) < 0.002);
    BOOST_TEST(std::abs(rates / echoes) < 0.0005);
    BOOST_TEST(std::abs(std::sqrt(rate_squares / echoes) - 0.03) < 0.0006);
    BOOST_TEST(std::abs(static_cast<double>(outside) / echoes - 0.0455) < 0.003);
}

BOOST_AUTO_TEST_CASE(it_sees_only_what_is_in_reach) {
    platoon::radar sensor{{}, 1};
    BOOST_TEST(sensor.measure({.range = 149, .rate = 0}).has_value());
    BOOST_TEST(!sensor.measure({.range = 151, .rate = 0}).has_value());
    platoon::radar none{{.fitted = false}, 1};
    BOOST_TEST(!none.measure({.range = 20, .rate = 0}).has_value());
}

BOOST_AUTO_TEST_SUITE_END()
