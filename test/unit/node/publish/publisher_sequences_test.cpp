// SPDX-License-Identifier: BSL-1.0
#include "node/publish/subscription.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(publisher_sequences)

BOOST_AUTO_TEST_CASE(each_publisher_has_its_own_sequence) {
    cles::core::publisher_sequences orders{8};
    BOOST_TEST(orders.of("car1").take(1, 7).has_value());
    BOOST_TEST(orders.of("car2").take(1, 7).has_value());
    BOOST_TEST(!orders.of("car1").take(1, 7).has_value());
    BOOST_TEST(orders.of("car2").take(1, 9).value() == 1U);
}

BOOST_AUTO_TEST_CASE(beyond_the_limit_the_least_recent_publisher_is_forgotten) {
    cles::core::publisher_sequences orders{2};
    orders.of("car1").take(1, 7);
    orders.of("car2").take(1, 7);
    orders.of("car1").take(1, 8);
    orders.of("car3").take(1, 1);
    BOOST_TEST(orders.size() == 2U);
    BOOST_TEST(!orders.of("car1").take(1, 8).has_value());
    BOOST_TEST(orders.of("car2").take(1, 7).has_value()); // forgotten meanwhile
}

BOOST_AUTO_TEST_SUITE_END()
