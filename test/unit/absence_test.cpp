// SPDX-License-Identifier: BSL-1.0
#include "core/absence.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(absence)

using namespace std::chrono_literals;
using cles::time_point;
using cles::core::absence;

namespace {

constexpr time_point start{1h};

} // namespace

BOOST_AUTO_TEST_CASE(a_timer_that_is_late_shows_that_the_node_was_stopped) {
    absence a;
    a.expect(start + 1s, start);
    BOOST_TEST(a.ended(start + 1s + absence::punctual + 1ms));
}

BOOST_AUTO_TEST_CASE(one_that_is_a_little_late_does_not) {
    absence a;
    a.expect(start + 1s, start);
    BOOST_TEST(!a.ended(start + 1s + absence::punctual));
}

BOOST_AUTO_TEST_CASE(what_was_due_long_before_the_timer_was_set_shows_nothing) {
    absence a;
    a.expect(start - 10s, start);
    BOOST_TEST(!a.ended(start + 1ms));
}

BOOST_AUTO_TEST_CASE(a_stop_is_noticed_though_the_timer_is_set_anew_before_it_goes_off) {
    absence a;
    a.expect(start + 1s, start);
    a.expect(start + 500ms, start + 10s);
    BOOST_TEST(a.ended(start + 10s));
}

BOOST_AUTO_TEST_CASE(each_stop_is_noticed_once) {
    absence a;
    a.expect(start + 1s, start);
    BOOST_TEST(a.ended(start + 10s));
    BOOST_TEST(!a.ended(start + 10s));
    a.expect(start + 11s, start + 10s);
    BOOST_TEST(!a.ended(start + 11s));
}

BOOST_AUTO_TEST_SUITE_END()
