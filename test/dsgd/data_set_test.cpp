// SPDX-License-Identifier: BSL-1.0
#include "sgd/data_set.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <numbers>
#include <stdexcept>

BOOST_AUTO_TEST_SUITE(data_set)

BOOST_AUTO_TEST_CASE(a_recipe_gives_the_same_points_again) {
    const sgd::data_set one{sgd::recipe{.seed = 7, .per_class = 100}};
    const sgd::data_set same{sgd::recipe{.seed = 7, .per_class = 100}};
    const sgd::data_set other{sgd::recipe{.seed = 8, .per_class = 100}};
    BOOST_TEST(one.size() == 200U);
    for (std::size_t i = 0; i < one.size(); ++i) {
        BOOST_TEST(one[i].x == same[i].x);
        BOOST_TEST(one[i].y == same[i].y);
        BOOST_TEST(one[i].x != other[i].x);
    }
}

// If a machine or a library generated other numbers, the same recipe would produce other data.
BOOST_AUTO_TEST_CASE(the_points_are_those_of_all_machines) {
    const sgd::data_set data{sgd::recipe{.seed = 1, .per_class = 2}};
    BOOST_TEST(data[0].x == -2.0454215287689097, boost::test_tools::tolerance(1e-12));
    BOOST_TEST(data[0].y == -0.8891012005789236, boost::test_tools::tolerance(1e-12));
    BOOST_TEST(data[3].x == 3.530397638269776, boost::test_tools::tolerance(1e-12));
}

BOOST_AUTO_TEST_CASE(each_class_is_normally_distributed_about_its_mean) {
    const sgd::data_set data{sgd::recipe{.seed = 3, .per_class = 50'000, .separation = 6}};
    for (const std::size_t label : {0U, 1U}) {
        double x = 0;
        double y = 0;
        double squares = 0;
        double product = 0;
        double within = 0;
        const auto mean = (label == 0 ? -3 : 3) / std::numbers::sqrt2;
        for (std::size_t i = label; i < data.size(); i += 2) {
            BOOST_TEST_REQUIRE(sgd::data_set::label(i) == static_cast<double>(label));
            const auto dx = data[i].x - mean;
            const auto dy = data[i].y - mean;
            x += dx;
            y += dy;
            squares += dx * dx + dy * dy;
            product += dx * dy;
            within += std::abs(dx) < 1 ? 1 : 0;
        }
        // About five standard errors.
        BOOST_TEST(std::abs(x / 50'000) < 0.023);
        BOOST_TEST(std::abs(y / 50'000) < 0.023);
        BOOST_TEST(std::abs(squares / 100'000 - 1) < 0.023);
        BOOST_TEST(std::abs(product / 50'000) < 0.023);
        BOOST_TEST(std::abs(within / 50'000 - 0.6827) < 0.011);
    }
}

BOOST_AUTO_TEST_CASE(a_recipe_for_too_many_points_is_refused) {
    BOOST_CHECK_THROW(sgd::data_set{sgd::recipe{.per_class = 0}}, std::invalid_argument);
    BOOST_CHECK_THROW(sgd::data_set{sgd::recipe{.per_class = sgd::most_per_class + 1}}, std::invalid_argument);
    BOOST_CHECK_THROW(sgd::data_set{sgd::recipe{.per_class = std::uint64_t(-1)}}, std::invalid_argument);
}

BOOST_AUTO_TEST_CASE(a_recipe_is_told_to_people) {
    BOOST_TEST(to_string(sgd::recipe{}) == "100000 points per class, 7 apart, from seed 1");
    BOOST_TEST(to_string(sgd::recipe{.separation = 2.5}) == "100000 points per class, 2.5 apart, from seed 1");
}

BOOST_AUTO_TEST_SUITE_END()
