// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/manoeuvre.hpp"
#include "platoon/driver/motion.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cmath>

namespace motion {
namespace {

constexpr double lag = 0.3;

} // namespace
} // namespace motion

BOOST_AUTO_TEST_SUITE(motion)

BOOST_AUTO_TEST_CASE(many_small_steps_are_one_large_one, *boost::unit_test::tolerance(1e-9)) {
    const platoon::motion from{.x = 3, .v = 25, .a = -1};
    auto small = from;
    for (int i = 0; i < 100; ++i) {
        small = advance(small, 2, lag, 0.01);
    }
    const auto large = advance(from, 2, lag, 1);
    BOOST_TEST(small.x == large.x);
    BOOST_TEST(small.v == large.v);
    BOOST_TEST(small.a == large.a);
}

// The equations, integrated in steps so small that their error does not matter.
BOOST_AUTO_TEST_CASE(it_does_what_the_equations_say, *boost::unit_test::tolerance(1e-5)) {
    platoon::motion euler{.x = 0, .v = 20, .a = 1};
    constexpr int steps = 1'000'000;
    for (int i = 0; i < steps; ++i) {
        constexpr double dt = 2.0 / steps;
        euler.x += euler.v * dt;
        euler.v += euler.a * dt;
        euler.a += (-4 - euler.a) / lag * dt;
    }
    const auto exact = platoon::advance({.x = 0, .v = 20, .a = 1}, -4, lag, 2);
    BOOST_TEST(exact.x == euler.x);
    BOOST_TEST(exact.v == euler.v);
    BOOST_TEST(exact.a == euler.a);
}

BOOST_AUTO_TEST_CASE(it_does_not_roll_backwards) {
    platoon::motion m{.x = 0, .v = 2, .a = 0};
    double last = 0;
    for (int i = 0; i < 500; ++i) {
        m = advance(m, -5, lag, 0.01);
        BOOST_TEST(m.x >= last);
        last = m.x;
    }
    BOOST_TEST(m.v == 0);
    BOOST_TEST(m.a == 0);
}

BOOST_AUTO_TEST_CASE(where_it_stops_does_not_depend_on_the_steps, *boost::unit_test::tolerance(1e-5)) {
    const platoon::motion from{.x = 0, .v = 10, .a = 0};
    auto small = from;
    for (int i = 0; i < 300'000; ++i) {
        small = advance(small, -3, lag, 1e-4);
    }
    const auto large = advance(from, -3, lag, 30);
    BOOST_TEST(large.v == 0);
    BOOST_TEST(large.x == small.x);
}

BOOST_AUTO_TEST_CASE(the_leader_brakes_and_takes_up_speed_again) {
    const platoon::manoeuvre plan;
    platoon::motion m{.x = 0, .v = plan.speed, .a = 0};
    double least = m.v;
    double last = 0;
    for (double t = 0; t < plan.end() + 3; t += 0.001) {
        const double command = plan.command(t);
        BOOST_TEST_REQUIRE(std::abs(command - last) <= plan.jerk * 0.001 + 1e-9);
        m = advance(m, command, lag, 0.001);
        least = std::min(least, m.v);
        last = command;
    }
    BOOST_TEST(std::abs(least - plan.slow) < 0.05);
    BOOST_TEST(std::abs(m.v - plan.speed) < 0.05);
}

BOOST_AUTO_TEST_CASE(one_who_keeps_its_speed_commands_nothing) {
    const platoon::manoeuvre plan{.speed = 20, .slow = 20};
    for (double t = 0; t < 60; t += 0.1) {
        BOOST_TEST_REQUIRE(plan.command(t) == 0);
    }
}

BOOST_AUTO_TEST_CASE(with_any_lag_a_vehicle_responds_as_the_platoon_does) {
    for (const double lag : {0.2, 0.3, 0.5}) {
        platoon::motion own{.x = 0, .v = 25, .a = 0};
        platoon::motion wanted = own;
        for (int i = 0; i < 200; ++i) {
            const double command = i < 100 ? -4 : 1;
            own = advance(own, platoon::compensated(command, own.a, lag), lag, 0.01);
            wanted = advance(wanted, command, platoon::platoon_lag, 0.01);
            BOOST_TEST(std::abs(own.a - wanted.a) < 0.05, lag << " s, step " << i);
        }
        BOOST_TEST(std::abs(own.x - wanted.x) < 0.02, lag << " s");
    }
}

BOOST_AUTO_TEST_SUITE_END()
