// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/track.hpp"

#include <boost/test/unit_test.hpp>

namespace track {
namespace {

constexpr double lag = 0.3;

platoon::state told(double t, const platoon::motion& m, double u, double j = 0) {
    return {.t = t, .x = m.x, .v = m.v, .a = m.a, .u = u, .j = j};
}

} // namespace
} // namespace track

BOOST_AUTO_TEST_SUITE(track)

BOOST_AUTO_TEST_CASE(what_keeps_its_command_is_where_it_is_said_to_be, *boost::unit_test::tolerance(1e-9)) {
    platoon::track other;
    BOOST_TEST(!other.known());
    const platoon::motion start{.x = 100, .v = 25, .a = 0.5};
    other.receive(told(7, start, -3), 0);
    for (const double age : {0.0, 0.04, 0.3, 0.9}) {
        const auto truth = advance(start, -3, lag, age);
        BOOST_TEST(other.at(age).x == truth.x);
        BOOST_TEST(other.at(age).v == truth.v);
    }
}

BOOST_AUTO_TEST_CASE(a_command_that_changes_steadily_is_carried_on, *boost::unit_test::tolerance(1e-9)) {
    platoon::track other;
    other.receive(told(0, {.x = 0, .v = 25, .a = 0}, -1, -5), 0);
    BOOST_TEST(other.command_at(0.1) == -1.5);
    BOOST_TEST(other.command_at(10) == other.command_at(0.3)); // a change is extrapolated for a short time only
}

BOOST_AUTO_TEST_CASE(what_others_tell_replaces_its_last_command, *boost::unit_test::tolerance(1e-9)) {
    platoon::track other;
    const platoon::motion start{.x = 0, .v = 25, .a = 0};
    other.receive(told(0, start, -1, -5), 0);
    const auto then = other.at(0.2);
    other.assume(2, 0.2);
    BOOST_TEST(other.at(0.2).x == then.x);
    BOOST_TEST(other.command_at(0.5) == 2);
    BOOST_TEST(other.at(0.5).v == advance(then, 2, lag, 0.3).v);
    BOOST_TEST(other.silence(0.5) == 0.5);
    other.receive(told(0.6, start, -4), 0.6); // an update counts more
    BOOST_TEST(other.command_at(0.6) == -4);
}

BOOST_AUTO_TEST_CASE(silence_is_counted_by_local_time) {
    platoon::track other;
    other.receive(told(1e6, {}, 0), 5);
    BOOST_TEST(other.silence(5.25) == 0.25);
    other.receive(told(1e6 + 0.001, {}, 0), 6); // independent of the sender's clock
    BOOST_TEST(other.silence(6.5) == 0.5);
}

BOOST_AUTO_TEST_CASE(one_that_comes_late_is_known_to_be_late, *boost::unit_test::tolerance(1e-3)) {
    platoon::track other;
    const platoon::motion start{.x = 0, .v = 20, .a = 0};
    other.receive(told(50, start, 0), 0);                                // the minimum delay
    other.receive(told(50.1, {.x = 2, .v = 20, .a = 0}, 0), 0.1 + 0.05); // 50 ms late
    BOOST_TEST(other.at(0.15).x == 3.0);
}

BOOST_AUTO_TEST_CASE(one_that_was_overtaken_is_dropped) {
    platoon::track other;
    other.receive(told(2, {.x = 20, .v = 10, .a = 0}, 0), 2);
    other.receive(told(1.9, {.x = 19, .v = 10, .a = 0}, 0), 2.01);
    BOOST_TEST(other.last().x == 20);
    BOOST_TEST(other.silence(3) == 1);
}

BOOST_AUTO_TEST_CASE(one_that_was_started_again_begins_anew) {
    platoon::track other;
    other.receive(told(500, {.x = 20, .v = 10, .a = 0}, 0), 2);
    other.receive(told(0, {.x = 7, .v = 10, .a = 0}, 0), 3);
    BOOST_TEST(other.last().x == 7);
    BOOST_TEST(other.at(3).x == 7);
}

BOOST_AUTO_TEST_CASE(the_lag_is_that_of_the_sender, *boost::unit_test::tolerance(1e-9)) {
    platoon::track other;
    other.receive({.t = 0, .x = 0, .v = 25, .u = -3, .lag = 0.8}, 0);
    BOOST_TEST(other.at(0.3).v == platoon::advance({.x = 0, .v = 25, .a = 0}, -3, 0.8, 0.3).v);
}

BOOST_AUTO_TEST_SUITE_END()
