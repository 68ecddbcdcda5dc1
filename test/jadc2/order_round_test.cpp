// SPDX-License-Identifier: BSL-1.0
#include "jadc2/order_round.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(order_round)

using step = jadc2::order_round::step;

BOOST_AUTO_TEST_CASE(each_node_is_asked_once) {
    jadc2::order_round round{100};
    auto next = round.next({"strike1", "strike2"}, 90);
    BOOST_TEST((next.what == step::offer));
    BOOST_TEST(next.node == "strike1");
    round.refused("no weapon is left");
    next = round.next({"strike1", "strike2"}, 91);
    BOOST_TEST((next.what == step::offer));
    BOOST_TEST(next.node == "strike2");
    round.refused("too far");
    BOOST_TEST((round.next({"strike2", "strike1"}, 92).what == step::end));
    BOOST_TEST(round.trouble() == "too far");
    BOOST_TEST(round.next({"strike1", "strike2", "strike3"}, 93).node == "strike3"); // it has just been found
}

BOOST_AUTO_TEST_CASE(until_a_node_is_known_it_waits) {
    jadc2::order_round round{100};
    BOOST_TEST((round.next({}, 90).what == step::wait));
    BOOST_TEST(round.next({"strike1"}, 99.9).node == "strike1");
    BOOST_TEST((round.next({}, 99.95).what == step::end));
}

BOOST_AUTO_TEST_CASE(after_the_end_nobody_is_asked) {
    jadc2::order_round round{100};
    BOOST_TEST((round.next({"strike1"}, 100).what == step::end));
    BOOST_TEST((round.next({}, 100).what == step::end));
    BOOST_TEST(round.trouble().empty());
}

BOOST_AUTO_TEST_SUITE_END()
