// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/observer.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <string>
#include <vector>

namespace observer {
namespace {

using names = std::vector<std::string>;

platoon::state at(double t, double x, platoon::role mode = platoon::role::follow) {
    return {.mode = mode, .t = t, .x = x, .v = 25};
}

struct watching {
    platoon::observer who{platoon::gains{}};

    watching() {
        who.take("b", at(0, 0), 0);
        who.take("a", at(0, 15, platoon::role::lead), 0);
        who.take("c", at(0, -15), 0);
    }
};

} // namespace
} // namespace observer

BOOST_FIXTURE_TEST_SUITE(observer, ::observer::watching)

using platoon::role;

BOOST_AUTO_TEST_CASE(counts_who_is_there_in_the_order_of_the_lane) {
    BOOST_TEST((who.vehicles() == names{"a", "b", "c"}));
    BOOST_TEST((who.lane(0.01) == names{"a", "b", "c"}));
    who.take("d", at(0.5, 80), 0.5);
    BOOST_TEST((who.lane(0.6) == names{"d", "a", "b", "c"}));
    BOOST_TEST(who.lane(-1).empty());
}

BOOST_AUTO_TEST_CASE(one_in_the_next_lane_is_there_and_not_in_the_lane) {
    who.take("d", at(0, 7, role::merge), 0);
    BOOST_TEST(who.vehicles().size() == 4U);
    BOOST_TEST((who.lane(0) == names{"a", "b", "c"}));
}

BOOST_AUTO_TEST_CASE(tells_changes_of_modes_once) {
    BOOST_TEST(!who.take("b", at(0.1, 2.5), 0.1));
    const auto changed = who.take("b", at(0.2, 5, role::radar), 0.21);
    BOOST_REQUIRE(changed.has_value());
    BOOST_TEST(changed->vehicle == "b");
    BOOST_TEST(changed->mode == "radar");
    BOOST_TEST(changed->t == 0.21);
    BOOST_TEST(!who.take("b", at(0.3, 7.5, role::radar), 0.31));
    BOOST_TEST((who.book().mode("b", 0.15) == role::follow));
    BOOST_TEST((who.book().mode("b", 0.25) == role::radar));
}

BOOST_AUTO_TEST_CASE(of_a_vehicle_that_changes_its_mode_all_the_time_some_changes_are_told) {
    int told = 0;
    for (int i = 1; i <= 900; ++i) { // 18 s
        const double t = i * 0.02;
        told += who.take("b", at(t, 25 * t, i % 2 == 0 ? role::follow : role::radar), t) ? 1 : 0;
    }
    BOOST_TEST(told == 20);
    BOOST_TEST((who.book().mode("b", 18) == role::follow));
}

BOOST_AUTO_TEST_CASE(hears_so_many_vehicles_and_forgets_silent_ones_for_new_ones) {
    for (int i = 0; i < 100; ++i) {
        who.take("x" + std::to_string(i), at(1, 100 + 15 * i), 1);
    }
    BOOST_TEST(who.vehicles().size() == platoon::observer::most_vehicles);
    BOOST_TEST(who.end_silent(2.5, 2).size() == 3U); // a, b and c
    who.take("y", at(2.5, 0), 2.5);
    BOOST_TEST(who.vehicles().size() == platoon::observer::most_vehicles);
    BOOST_TEST((who.book().last("y") != nullptr));
    BOOST_TEST((who.book().last("a") == nullptr));
    BOOST_TEST((who.book().last("x0") != nullptr));
}

BOOST_AUTO_TEST_CASE(what_no_vehicle_can_send_does_not_count) {
    who.take("x", {.t = 0, .x = NAN}, 0);
    BOOST_TEST(who.vehicles().size() == 3U);
}

BOOST_AUTO_TEST_CASE(those_that_fall_silent_are_told_once_and_may_return) {
    who.take("a", at(3, 90, role::lead), 3);
    who.take("c", at(3, 60, role::leave), 0);
    const auto gone = who.end_silent(3, 2);
    BOOST_REQUIRE(gone.size() == 2U);
    BOOST_TEST(gone[0].vehicle == "b");
    BOOST_TEST(gone[0].mode == "silent");
    BOOST_TEST(gone[1].mode == "left");
    BOOST_TEST(who.end_silent(3, 2).empty());
    BOOST_TEST((who.lane(3.1) == names{"a", "b"})); // c is no longer there; b brakes, as far as anybody knows
    const auto back = who.take("b", at(4, 100), 4);
    BOOST_REQUIRE(back.has_value());
    BOOST_TEST(back->mode == "follow");
    BOOST_TEST(!who.book().has_ended("b"));
}

BOOST_AUTO_TEST_CASE(some_are_not_ended_by_their_silence) {
    BOOST_TEST(who.end_silent(9, 2, {"a", "b"}).size() == 1U);
    BOOST_TEST(!who.book().has_ended("a"));
}

BOOST_AUTO_TEST_CASE(a_recorded_end_stays) {
    who.record_end("b", false);
    who.take("b", at(0.1, 2.5), 0.1); // was on its way
    BOOST_TEST(who.book().has_ended("b"));
}

BOOST_AUTO_TEST_CASE(desired_distances_follow_from_the_brakes_that_vehicles_state) {
    auto weak = at(0.1, 2.5);
    weak.brake = 5;
    who.take("b", weak, 0.1);
    const auto desired = who.desired({"a", "b", "c"}, 15, 25);
    BOOST_REQUIRE(desired.size() == 3U);
    BOOST_TEST(std::abs(desired[1] - platoon::wanted_distance(15, 25, 5, 8)) < 1e-9);
    BOOST_TEST(desired[2] == 15.0);
}

BOOST_AUTO_TEST_SUITE_END()
