// SPDX-License-Identifier: BSL-1.0
#include "node/session/datagram_rules.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <deque>
#include <string>
#include <utility>

BOOST_AUTO_TEST_SUITE(reflection_limit)

using namespace std::chrono_literals;
using cles::time_point;

const time_point start{1h};

BOOST_AUTO_TEST_CASE(an_address_gets_less_than_64_KiB_in_any_second) {
    cles::core::reflection_limit limit;
    std::deque<std::pair<time_point, std::size_t>> window;
    std::size_t in_window = 0;
    std::size_t sent = 0;
    for (auto now = start; now < start + 5s; now += 1ms) {
        for (int i = 0; i < 3; ++i) { // asks for far more
            if (limit.admit("192.0.2.1", 1200, now)) {
                window.emplace_back(now, 1200);
                in_window += 1200;
                sent += 1200;
            }
        }
        while (!window.empty() && window.front().first <= now - 1s) {
            in_window -= window.front().second;
            window.pop_front();
        }
        BOOST_REQUIRE(in_window < 65536U);
    }
    BOOST_TEST(sent > 5U * 45U * 1024U); // and not far below the limit
}

// Both ends of the second count: what is sent at its start may arrive a little later.
BOOST_AUTO_TEST_CASE(the_limit_is_not_even_reached_exactly) {
    for (const std::size_t size : {29U, 64U, 100U, 1024U, 1228U}) {
        cles::core::reflection_limit limit;
        limit.admit("192.0.2.1", size, start - 10s); // its bucket is full at the start of the second
        std::size_t sent = 0;
        for (auto now = start; now <= start + 1s + 50ms; now += 1ms) {
            while (limit.admit("192.0.2.1", size, now)) {
                sent += size;
            }
        }
        BOOST_TEST(sent < 65536U, size);
        BOOST_TEST(sent > 60000U, size);
    }
}

BOOST_AUTO_TEST_CASE(addresses_are_independent) {
    cles::core::reflection_limit limit;
    while (limit.admit("192.0.2.1", 1000, start)) {
    }
    BOOST_TEST(limit.admit("192.0.2.2", 1000, start));
    BOOST_TEST(!limit.admit("192.0.2.1", 1000, start));
}

BOOST_AUTO_TEST_CASE(a_small_datagram_may_pass_if_a_large_one_does_not) {
    cles::core::reflection_limit limit;
    while (limit.admit("192.0.2.1", 1200, start)) {
    }
    BOOST_TEST(limit.admit("192.0.2.1", 100, start));
}

BOOST_AUTO_TEST_CASE(an_address_recovers) {
    cles::core::reflection_limit limit;
    while (limit.admit("192.0.2.1", 1200, start)) {
    }
    BOOST_TEST(!limit.admit("192.0.2.1", 1200, start + 1ms));
    BOOST_TEST(limit.admit("192.0.2.1", 1200, start + 100ms));
}

BOOST_AUTO_TEST_CASE(the_number_of_forged_addresses_is_limited_and_they_are_forgotten) {
    using limit_type = cles::core::reflection_limit;
    limit_type limit;
    for (std::size_t i = 0; i < limit_type::max_addresses; ++i) {
        BOOST_REQUIRE(limit.admit("10." + std::to_string(i), 100, start));
    }
    BOOST_TEST(!limit.admit("192.0.2.1", 100, start));
    BOOST_TEST(limit.admit("10.5", 100, start)); // known addresses continue
    BOOST_TEST(limit.addresses() == limit_type::max_addresses);
    BOOST_TEST(limit.admit("192.0.2.1", 100, start + 1s));
    BOOST_TEST(limit.addresses() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
