// SPDX-License-Identifier: BSL-1.0
#include "node/base/deadlines.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(suspend_detector)

using namespace std::chrono_literals;
using cles::time_point;
using cles::core::suspend_detector;

namespace {

constexpr time_point start{1h};

} // namespace

BOOST_AUTO_TEST_CASE(a_late_timer_shows_that_the_node_was_suspended) {
    suspend_detector a;
    a.expect(start + 1s, start);
    BOOST_TEST(a.ended(start + 1s + suspend_detector::punctual + 1ms));
}

BOOST_AUTO_TEST_CASE(a_slightly_late_timer_does_not) {
    suspend_detector a;
    a.expect(start + 1s, start);
    BOOST_TEST(!a.ended(start + 1s + suspend_detector::punctual));
}

BOOST_AUTO_TEST_CASE(a_deadline_long_before_the_timer_was_set_proves_nothing) {
    suspend_detector a;
    a.expect(start - 10s, start);
    BOOST_TEST(!a.ended(start + 1ms));
}

BOOST_AUTO_TEST_CASE(a_suspension_is_detected_if_the_timer_is_set_again_first) {
    suspend_detector a;
    a.expect(start + 1s, start);
    a.expect(start + 500ms, start + 10s);
    BOOST_TEST(a.ended(start + 10s));
}

BOOST_AUTO_TEST_CASE(each_suspension_is_reported_once) {
    suspend_detector a;
    a.expect(start + 1s, start);
    BOOST_TEST(a.ended(start + 10s));
    BOOST_TEST(!a.ended(start + 10s));
    a.expect(start + 11s, start + 10s);
    BOOST_TEST(!a.ended(start + 11s));
}

BOOST_AUTO_TEST_SUITE_END()
