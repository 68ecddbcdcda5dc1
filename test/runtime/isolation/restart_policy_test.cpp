// SPDX-License-Identifier: BSL-1.0
#include "isolation/restart_policy.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(restart_policy)

using namespace std::chrono_literals;
using policy = cles::runtime::restart_policy;
using decision = policy::decision;

namespace {

cles::time_point at(std::chrono::milliseconds since) { return cles::time_point{1h} + since; }

} // namespace

BOOST_AUTO_TEST_CASE(the_third_end_within_a_minute_withdraws) {
    policy p;
    BOOST_TEST((p.ended(at(0s)) == decision::restart));
    BOOST_TEST((p.ended(at(30s)) == decision::restart));
    BOOST_TEST(!p.withdrawn());
    BOOST_TEST((p.ended(at(59'999ms)) == decision::withdraw));
    BOOST_TEST(p.withdrawn());
}

BOOST_AUTO_TEST_CASE(ends_that_are_further_apart_do_not) {
    policy p;
    for (int i = 0; i < 100; ++i) {
        BOOST_TEST((p.ended(at(i * 30s)) == decision::restart));
    }
    BOOST_TEST((p.ended(at(100 * 30s - 1ms)) == decision::withdraw));
}

BOOST_AUTO_TEST_CASE(the_period_slides) {
    policy p;
    BOOST_TEST((p.ended(at(0s)) == decision::restart));
    BOOST_TEST((p.ended(at(59s)) == decision::restart));
    BOOST_TEST((p.ended(at(60s)) == decision::restart)); // the first is a minute old
    BOOST_TEST((p.ended(at(61s)) == decision::withdraw));
}

BOOST_AUTO_TEST_CASE(once_withdrawn_it_stays_so_until_it_is_reset) {
    policy p;
    p.ended(at(0s));
    p.ended(at(1s));
    p.ended(at(2s));
    BOOST_TEST((p.ended(at(3h)) == decision::withdraw));
    BOOST_TEST(p.reset());
    BOOST_TEST(!p.withdrawn());
    BOOST_TEST(!p.reset());
    BOOST_TEST((p.ended(at(3h)) == decision::restart)); // earlier ends are forgotten
    BOOST_TEST((p.ended(at(3h)) == decision::restart));
    BOOST_TEST((p.ended(at(3h)) == decision::withdraw));
}

BOOST_AUTO_TEST_CASE(delays_double_up_to_a_limit_and_do_not_withdraw) {
    policy p;
    for (const auto expected : {100ms, 200ms, 400ms, 800ms, 1600ms, 3200ms, 5000ms, 5000ms}) {
        BOOST_TEST((p.delay(at(0s)) == expected));
    }
    for (int i = 0; i < 100; ++i) {
        BOOST_TEST((p.delay(at(1s)) == 5000ms));
    }
    BOOST_TEST(!p.withdrawn());
    BOOST_TEST((p.delay(at(60'999ms)) == 5000ms));
    BOOST_TEST((p.delay(at(121s)) == 100ms)); // a minute later, the past is forgotten
    BOOST_TEST((p.ended(at(122s)) == decision::restart));
}

BOOST_AUTO_TEST_SUITE_END()
