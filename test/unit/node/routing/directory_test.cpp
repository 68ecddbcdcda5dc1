// SPDX-License-Identifier: BSL-1.0
#include "node/routing/peer_channels.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(directory)

BOOST_AUTO_TEST_CASE(last_configured_url_counts) {
    cles::core::directory where;
    BOOST_TEST(where.find("car1").empty());
    where.set("car1", "tcp://10.0.0.2:25370");
    where.set("car2", "unix:///run/car2.sock");
    BOOST_TEST(where.find("car1") == "tcp://10.0.0.2:25370");
    where.set("car1", "tcp://10.0.0.3:25370");
    BOOST_TEST(where.find("car1") == "tcp://10.0.0.3:25370");
    BOOST_TEST(where.find("car2") == "unix:///run/car2.sock");
    BOOST_TEST(where.find("Car1").empty());
}

BOOST_AUTO_TEST_CASE(empty_url_removes_the_node) {
    cles::core::directory where;
    where.set("car1", "tcp://10.0.0.2:25370");
    where.set("car1", "");
    where.set("car9", "");
    BOOST_TEST(where.find("car1").empty());
}

BOOST_AUTO_TEST_SUITE_END()
