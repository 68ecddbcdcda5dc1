// SPDX-License-Identifier: BSL-1.0
#include "node/base/deadlines.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(saturating_add)

using cles::time_point;
using cles::core::saturating_add;
using namespace std::chrono_literals;

BOOST_AUTO_TEST_CASE(it_adds) {
    const time_point now{12h};
    BOOST_TEST((saturating_add(now, 5ms) == now + 5ms));
    BOOST_TEST((saturating_add(now, -5ms) == now - 5ms));
    BOOST_TEST((saturating_add(now, 0ns) == now));
    BOOST_TEST((saturating_add(now, 24h) == now + 24h));
}

BOOST_AUTO_TEST_CASE(it_stops_at_the_limits_of_time) {
    for (const auto now :
         {time_point{}, time_point{12h}, time_point::max() - 1s, time_point::max(), time_point{-12h}}) {
        BOOST_TEST((saturating_add(now, std::chrono::milliseconds::max()) == time_point::max()));
        BOOST_TEST((saturating_add(now, std::chrono::hours::max()) == time_point::max()));
    }
    BOOST_TEST((saturating_add(time_point{12h}, std::chrono::milliseconds::min()) == time_point::min()));
    BOOST_TEST((saturating_add(time_point{-12h}, std::chrono::hours::min()) == time_point::min()));
    BOOST_TEST((saturating_add(time_point::max(), 1ms) == time_point::max()));
    BOOST_TEST((saturating_add(time_point::min(), -1ms) == time_point::min()));
}

static_assert(saturating_add(time_point{}, std::chrono::nanoseconds::max()) == time_point::max());

BOOST_AUTO_TEST_SUITE_END()
