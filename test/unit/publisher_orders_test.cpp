// SPDX-License-Identifier: BSL-1.0
#include "core/publisher_orders.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(publisher_orders)

BOOST_AUTO_TEST_CASE(each_publisher_has_an_order_of_its_own) {
    cles::core::publisher_orders orders{8};
    BOOST_TEST(orders.of("car1").take(1, 7).news);
    BOOST_TEST(orders.of("car2").take(1, 7).news);
    BOOST_TEST(!orders.of("car1").take(1, 7).news);
    BOOST_TEST(orders.of("car2").take(1, 9).missed == 1U);
}

BOOST_AUTO_TEST_CASE(past_the_limit_the_one_silent_for_longest_is_forgotten) {
    cles::core::publisher_orders orders{2};
    orders.of("car1").take(1, 7);
    orders.of("car2").take(1, 7);
    orders.of("car1").take(1, 8);
    orders.of("car3").take(1, 1);
    BOOST_TEST(orders.size() == 2U);
    BOOST_TEST(!orders.of("car1").take(1, 8).news);
    BOOST_TEST(orders.of("car2").take(1, 7).news); // anew
}

BOOST_AUTO_TEST_SUITE_END()
