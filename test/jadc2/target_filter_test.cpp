// SPDX-License-Identifier: BSL-1.0
#include "geo/normal.hpp"
#include "strike/target_filter.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

BOOST_AUTO_TEST_SUITE(target_filter)

BOOST_AUTO_TEST_CASE(time_makes_a_place_uncertain_in_both_directions) {
    for (const double seconds : {4.0, -4.0}) {
        strike::target_filter target{{.east = 10, .north = 20}, {.east = 3, .north = -2}, 2, 1};
        target.predict(seconds);
        BOOST_TEST(target.at().east == 10 + 3 * seconds);
        BOOST_TEST(target.at().north == 20 - 2 * seconds);
        BOOST_TEST(target.deviation() > std::hypot(2, 4)); // acceleration adds to it
        BOOST_TEST(target.deviation() < std::hypot(2, 4) + 0.5);
    }
}

BOOST_AUTO_TEST_CASE(a_measurement_counts_by_its_accuracy) {
    strike::target_filter target{{0, 0}, {0, 0}, 2, 1};
    target.correct({.east = 10, .north = 10}, {.ee = 4, .en = 0, .nn = 1e6});
    BOOST_TEST(std::abs(target.at().east - 5) < 1e-9); // as accurate as the track
    BOOST_TEST(std::abs(target.at().north) < 1e-3);
    BOOST_TEST(std::abs(target.deviation() - std::sqrt((2.0 + 4.0) / 2)) < 1e-3);
}

BOOST_AUTO_TEST_CASE(the_distance_depends_on_the_direction) {
    const strike::target_filter target{{0, 0}, {0, 0}, 1, 1};
    const strike::covariance noise{.ee = 3, .en = 0, .nn = 99};
    BOOST_TEST(std::abs(target.distance({.east = 4, .north = 0}, noise) - 4) < 1e-9);
    BOOST_TEST(std::abs(target.distance({.east = 0, .north = 10}, noise) - 1) < 1e-9);
}

// A track with a wrong place and a good velocity, measurements without a bias: after 30 of them, the error is as small
// as the filter says, over 300 targets. The sum of squares of two normal errors has the mean 2.
BOOST_AUTO_TEST_CASE(its_errors_are_as_large_as_it_says) {
    sgd::random_source chance{5};
    constexpr int targets = 300;
    double normalized = 0;
    double squares = 0;
    for (int i = 0; i < targets; ++i) {
        const geo::plane_position velocity{.east = 12, .north = -5};
        strike::target_filter target{
            {.east = geo::normal(chance) * 4, .north = geo::normal(chance) * 4},
            {.east = velocity.east + geo::normal(chance), .north = velocity.north + geo::normal(chance)},
            4,
            1};
        geo::plane_position truth{};
        for (int k = 0; k < 30; ++k) {
            target.predict(0.1);
            truth = {.east = truth.east + 0.1 * velocity.east, .north = truth.north + 0.1 * velocity.north};
            target.correct({.east = truth.east + geo::normal(chance) * 2, .north = truth.north + geo::normal(chance)},
                           {.ee = 4, .en = 0, .nn = 1});
        }
        normalized += target.distance(truth, {});
        squares += std::pow(target.at().east - truth.east, 2) + std::pow(target.at().north - truth.north, 2);
    }
    BOOST_TEST(normalized / targets > 1); // it assumes accelerations that there are not
    BOOST_TEST(normalized / targets < 2.3);
    BOOST_TEST(std::sqrt(squares / targets / 2) < 0.7);
}

BOOST_AUTO_TEST_SUITE_END()
