// SPDX-License-Identifier: BSL-1.0
#include "isolation/log_rate.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(log_rate)

using namespace std::chrono_literals;
using rate = cles::runtime::log_rate;

namespace {

cles::time_point at(std::chrono::milliseconds since) { return cles::time_point{1h} + since; }

int taken(rate& from, cles::time_point now, int wanted) {
    int count = 0;
    for (int i = 0; i < wanted; ++i) {
        count += from.take(now) ? 1 : 0;
    }
    return count;
}

} // namespace

BOOST_AUTO_TEST_CASE(a_burst_passes_and_the_rest_is_counted) {
    rate b;
    BOOST_TEST(taken(b, at(0s), 1000) == 200);
    BOOST_TEST(b.take_dropped() == 800);
    BOOST_TEST(b.take_dropped() == 0);
}

BOOST_AUTO_TEST_CASE(entries_are_earned_with_time) {
    rate b;
    taken(b, at(0s), 1000);
    BOOST_TEST(taken(b, at(9ms), 10) == 0);
    BOOST_TEST(taken(b, at(10ms), 10) == 1);
    BOOST_TEST(taken(b, at(1010ms), 1000) == 100);
    BOOST_TEST(taken(b, at(1h), 1000) == 200); // no more than a burst
}

BOOST_AUTO_TEST_CASE(slow_entries_all_pass) {
    rate b;
    for (int i = 0; i < 10'000; ++i) {
        BOOST_TEST(b.take(at(i * 10ms)));
    }
    BOOST_TEST(b.take_dropped() == 0);
}

BOOST_AUTO_TEST_SUITE_END()
