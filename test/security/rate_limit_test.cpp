// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/rate_limit.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <deque>
#include <random>

namespace rate_limit {
namespace {

using namespace std::chrono_literals;
using cles::time_point;

} // namespace

BOOST_AUTO_TEST_SUITE(rate_limit)

BOOST_AUTO_TEST_CASE(no_second_has_more_than_the_limit) {
    for (const std::uint32_t limit : {2U, 10U, 50U, 1000U}) {
        cles::security::rate_limit rate{limit};
        std::deque<time_point> taken;
        std::mt19937_64 random{limit};
        time_point now{1h};
        for (int i = 0; i < 20000; ++i) {
            now += std::chrono::microseconds{random() % (3'000'000 / limit)} / 4;
            if (rate.take(now)) {
                taken.push_back(now);
            }
            while (!taken.empty() && now - taken.front() >= 1s) {
                taken.pop_front();
            }
            BOOST_REQUIRE_MESSAGE(taken.size() <= limit, "limit " << limit);
        }
    }
}

BOOST_AUTO_TEST_CASE(most_of_the_limit_can_be_used) {
    for (const std::uint32_t limit : {10U, 50U, 1000U}) {
        cles::security::rate_limit rate{limit};
        int taken = 0;
        for (time_point now{1h}; now < time_point{1h + 10s}; now += 100us) {
            taken += rate.take(now) ? 1 : 0;
        }
        BOOST_TEST(taken >= static_cast<int>(limit) * 9);
    }
}

BOOST_AUTO_TEST_CASE(a_tenth_may_come_at_once) {
    cles::security::rate_limit rate{50};
    const time_point now{1h};
    for (int i = 0; i < 5; ++i) {
        BOOST_TEST(rate.take(now));
    }
    BOOST_TEST(!rate.take(now));
    BOOST_TEST(!rate.take(now + 20ms));
    BOOST_TEST(rate.take(now + 23ms));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace rate_limit
