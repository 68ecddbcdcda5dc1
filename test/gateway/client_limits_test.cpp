// SPDX-License-Identifier: BSL-1.0
#include "gateway/access/client_limits.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(client_limits)

BOOST_AUTO_TEST_CASE(an_address_has_a_limit) {
    gateway::client_limits limits{10, 2};
    const auto first = limits.admit("a");
    const auto second = limits.admit("a");
    limits.set_busy(first.number, true);
    const auto third = limits.admit("a"); // takes the place of the one that waits for its next request
    BOOST_TEST(third.number != 0U);
    BOOST_TEST((third.evicted == second.number));
    limits.set_busy(third.number, true);
    BOOST_TEST(limits.admit("a").number == 0U); // both are being served
    BOOST_TEST(limits.admit("b").number != 0U); // others are not concerned
    BOOST_TEST(limits.size() == 3U);
    limits.leave(first.number);
    const auto next = limits.admit("a");
    BOOST_TEST(next.number != 0U);
    BOOST_TEST(!next.evicted.has_value());
}

// One that only holds connections open does not shut out others.
BOOST_AUTO_TEST_CASE(the_address_with_the_most_gives_way) {
    gateway::client_limits limits{4, 3};
    const auto oldest = limits.admit("honest");
    std::vector<std::uint64_t> greedy;
    for (int i = 0; i < 3; ++i) {
        greedy.push_back(limits.admit("greedy").number);
    }
    const auto made = limits.admit("another");
    BOOST_TEST(made.number != 0U);
    BOOST_TEST((made.evicted == greedy.front()));
    limits.leave(oldest.number);
    BOOST_TEST(limits.size() == 3U);
}

BOOST_AUTO_TEST_CASE(those_that_are_served_stay) {
    gateway::client_limits limits{2, 0};
    for (const auto* const address : {"a", "b"}) {
        limits.set_busy(limits.admit(address).number, true);
    }
    const auto made = limits.admit("c");
    BOOST_TEST(made.number == 0U);
    BOOST_TEST(!made.evicted.has_value());
    BOOST_TEST(limits.size() == 2U);
}

BOOST_AUTO_TEST_CASE(an_address_may_be_unlimited) {
    gateway::client_limits limits{100, 0};
    for (int i = 0; i < 100; ++i) {
        BOOST_TEST(limits.admit("a").number != 0U);
    }
    BOOST_TEST(limits.admit("a").evicted.has_value());
}

BOOST_AUTO_TEST_CASE(what_has_left_may_leave_again) {
    gateway::client_limits limits{1, 1};
    const auto made = limits.admit("a");
    limits.leave(made.number);
    limits.leave(made.number);
    limits.set_busy(made.number, true);
    BOOST_TEST(limits.size() == 0U);
    BOOST_TEST(!limits.admit("a").evicted.has_value());
}

BOOST_AUTO_TEST_CASE(a_network_of_ipv6_is_one_client) {
    BOOST_TEST(gateway::client_address("127.0.0.1") == "127.0.0.1");
    BOOST_TEST(gateway::client_address("::ffff:10.0.0.7") == "10.0.0.7");
    BOOST_TEST(gateway::client_address("2001:db8:1:2:3:4:5:6") == "2001:db8:1:2::");
    BOOST_TEST(gateway::client_address("2001:db8:1:2::7") == "2001:db8:1:2::");
    BOOST_TEST(gateway::client_address("2001:db8:1:3::7") == "2001:db8:1:3::");
    BOOST_TEST(gateway::client_address("other") == "other");
}

BOOST_AUTO_TEST_SUITE_END()
