// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/driver.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <vector>

namespace driver {
namespace {

using platoon::role;

constexpr double period = 0.04;

/// v2 behind v1 behind v0, all at 25 m/s. The others report what the test sets.
struct road {
    platoon::driver v2{{.name = "v2", .ahead = "v1", .start = {.x = -30, .v = 25, .a = 0}}, 0};
    platoon::state v0{.mode = role::lead, .lead = "v0", .v = 25};
    platoon::state v1{.mode = role::follow, .ahead = "v0", .lead = "v0", .behind = 15, .x = -15, .v = 25};
    std::set<std::string> silent{};
    bool radar = false;
    double radar_error = 0; // m, of the place of v1
    double now = 0;

    void drive(double seconds) {
        for (const double end = now + seconds; now < end - 1e-9; now += period) {
            for (auto* other : {&v0, &v1}) {
                other->t = now;
            }
            tell("v0", v0);
            tell("v1", v1);
            if (radar) {
                const auto self = advance(v2.position(), v2.command(), 0.3, now - v2.now());
                v2.measure({.range = v1.x + radar_error - 5 - self.x, .rate = v1.v - self.v}, now);
            }
            v2.step(now);
            for (auto* other : {&v0, &v1}) {
                const auto next = advance(other->position(), other->u, 0.3, period);
                other->x = next.x;
                other->v = next.v;
                other->a = next.a;
            }
        }
    }
    void tell(const std::string& name, const platoon::state& what) {
        if (!silent.contains(name)) {
            v2.receive(name, what, now);
        }
    }
};

} // namespace
} // namespace driver

BOOST_AUTO_TEST_SUITE(driver)

BOOST_AUTO_TEST_CASE(it_learns_the_leader_from_the_one_ahead) {
    platoon::driver v2{{.name = "v2", .ahead = "v1"}, 0};
    BOOST_TEST((v2.needed() == std::set<std::string>{"v1"}));
    v2.receive("v1", {.ahead = "v0", .lead = "v0", .behind = 15, .x = 15}, 0);
    BOOST_TEST((v2.needed() == std::set<std::string>{"v0", "v1"}));
    BOOST_TEST(v2.report().behind == 30);
    BOOST_TEST(v2.report().lead == "v0");
}

BOOST_AUTO_TEST_CASE(the_one_ahead_may_not_know_who_leads) {
    road all;
    std::string said;
    all.v2.on_change = [&](double, role, const std::string& why) { said = why; };
    all.silent = {"v0"};
    all.v1.lead.clear();
    all.drive(2);
    BOOST_TEST((all.v2.mode() == role::degraded));
    BOOST_TEST(said == "v1 ahead does not report the leader");
}

BOOST_AUTO_TEST_CASE(in_its_place_it_does_nothing) {
    road all;
    all.drive(3);
    BOOST_TEST((all.v2.mode() == role::follow));
    BOOST_TEST(std::abs(all.v2.command()) < 1e-6);
    BOOST_TEST(std::abs(all.v1.x - period * 25 - all.v2.position().x - 15) < 1e-6);
}

/// The command of v3 after `seconds` in which the vehicles in `silent` are not received, and all ahead of it brake.
double command_of_v3(const std::set<std::string>& silent, double from_leader, double seconds) {
    platoon::driver v3{{.name = "v3", .ahead = "v2", .start = {.x = -45, .v = 25, .a = 0}}, 0};
    std::map<std::string, platoon::state> others{
        {"v0", {.mode = role::lead, .lead = "v0", .v = 25}},
        {"v1", {.mode = role::follow, .ahead = "v0", .lead = "v0", .behind = 15, .x = -15, .v = 25}},
        {"v2", {.mode = role::follow, .ahead = "v1", .lead = "v0", .behind = 30, .x = -30, .v = 25}}};
    for (double now = 0; now < 1 + seconds; now += period) {
        for (auto& [name, each] : others) {
            each.t = now;
            each.u = now < 1 ? 0 : -5;
            each.from_leader = now < 1 ? 0 : from_leader;
            if (now < 1 || !silent.contains(name)) {
                v3.receive(name, each, now);
            }
            const auto next = advance(each.position(), each.u, 0.3, period);
            each.x = next.x;
            each.v = next.v;
            each.a = next.a;
        }
        v3.step(now);
    }
    BOOST_TEST((v3.needed() == std::set<std::string>{"v0", "v1", "v2"}));
    return v3.command();
}

BOOST_AUTO_TEST_CASE(others_tell_what_one_does_whose_updates_are_missing) {
    const double all = command_of_v3({}, 0, 3 * period);
    const double one = command_of_v3({"v2"}, 0, 3 * period);
    const double two = command_of_v3({"v1", "v2"}, 0, 3 * period);
    BOOST_TEST(all < -0.5);
    BOOST_TEST(std::abs(one - all) < std::abs(two - all));
}

BOOST_AUTO_TEST_CASE(the_one_ahead_tells_what_the_leader_adds) {
    const double with = command_of_v3({"v0"}, -3, 3 * period);
    const double without = command_of_v3({"v0"}, 0, 3 * period);
    BOOST_TEST(with < without - 1);
    // If the leader is received, that does not count.
    BOOST_TEST(command_of_v3({}, -3, 3 * period) == command_of_v3({}, 0, 3 * period));
}

BOOST_AUTO_TEST_CASE(it_falls_back_when_three_updates_of_the_one_ahead_are_missed) {
    road all;
    all.drive(1);
    all.silent = {"v1"};
    all.drive(3 * period);
    BOOST_TEST((all.v2.mode() == role::follow));
    all.drive(period);
    BOOST_TEST((all.v2.mode() == role::fallback));
    BOOST_TEST(all.v2.command() < 0);
    all.drive(1);
    BOOST_TEST(all.v2.command() == -4);
    BOOST_TEST(all.v2.report().lead == "v2"); // those behind have to stop with it
    all.drive(12);
    BOOST_TEST(all.v2.position().v == 0);
    BOOST_TEST((all.v2.report().mode == role::fallback));
}

BOOST_AUTO_TEST_CASE(with_a_radar_it_falls_back_to_a_time_gap_instead) {
    road all;
    all.radar = true;
    all.drive(1);
    all.silent = {"v1"};
    all.drive(4 * period);
    BOOST_TEST((all.v2.mode() == role::radar));
    BOOST_TEST(std::abs(all.v2.command()) < 0.1); // a short interruption changes almost nothing
    BOOST_TEST(all.v2.report().lead == "v0");
    all.drive(1.5);
    BOOST_TEST(all.v2.report().lead == "v2"); // those behind have to make room with it
    all.drive(40);
    BOOST_TEST(std::abs(all.v2.position().v - 25) < 0.1);
    BOOST_TEST(std::abs(all.v1.x - period * 25 - all.v2.position().x - (5 + 5 + 1.5 * 25)) < 1);
    BOOST_TEST(std::abs(all.v2.desired_distance() - (5 + 5 + 1.5 * 25)) < 1);
    all.silent.clear();
    all.drive(60);
    BOOST_TEST((all.v2.mode() == role::follow));
    BOOST_TEST(std::abs(all.v1.x - period * 25 - all.v2.position().x - 15) < 0.05);
}

// v0 says that it drives on at 25 m/s, and stops.
BOOST_AUTO_TEST_CASE(it_brakes_by_its_radar_whatever_updates_say) {
    platoon::driver v1{{.name = "v1", .ahead = "v0", .start = {.x = -15, .v = 25, .a = 0}}, 0};
    platoon::motion truth{.x = 0, .v = 25, .a = 0};
    double least = 15;
    for (int i = 0; i < 600; ++i) {
        const double now = i * 0.01;
        if (i % 4 == 0) {
            v1.receive("v0", {.mode = role::lead, .lead = "v0", .t = now, .x = 25 * now, .v = 25}, now);
        }
        if (i % 8 == 0) {
            const auto self = advance(v1.position(), v1.command(), 0.3, now - v1.now());
            v1.measure({.range = truth.x - 5 - self.x, .rate = truth.v - self.v}, now);
        }
        v1.step(now);
        least = std::min(least, truth.x - v1.position().x);
        truth = advance(truth, -6, 0.3, 0.01);
    }
    BOOST_TEST(v1.position().v < 0.1);
    BOOST_TEST(least > 10);
}

BOOST_AUTO_TEST_CASE(updates_that_arrive_do_not_close_the_gap_of_a_poor_link) {
    road all;
    all.radar = true;
    all.drive(3);
    int changes = 0;
    all.v2.on_change = [&](double, role, const std::string&) { ++changes; };
    for (int i = 0; i < 10; ++i) {
        all.silent = {"v1"};
        all.drive(1.4);
        all.silent.clear();
        all.drive(5 * period);
        BOOST_TEST((all.v2.mode() == role::radar), i);
        BOOST_TEST(all.v2.report().lead == "v2", i);
    }
    BOOST_TEST(changes == 1);
    BOOST_TEST(all.v2.desired_distance() > 18);
    BOOST_TEST(all.v1.x - period * 25 - all.v2.position().x > 18);
    all.drive(60);
    BOOST_TEST((all.v2.mode() == role::follow));
    BOOST_TEST(changes == 2);
    BOOST_TEST(all.v2.report().lead == "v0");
    BOOST_TEST(std::abs(all.v1.x - period * 25 - all.v2.position().x - 15) < 0.05);
}

BOOST_AUTO_TEST_CASE(by_its_radar_it_stops_behind_one_that_stops) {
    road all;
    all.radar = true;
    all.drive(1);
    all.silent = {"v0", "v1"};
    all.drive(1);
    all.v1.u = -5;
    double least = 15;
    for (int i = 0; i < 250; ++i) {
        all.drive(period);
        least = std::min(least, all.v1.x - all.v2.position().x);
    }
    BOOST_TEST((all.v2.mode() == role::radar));
    BOOST_TEST(all.v2.position().v < 0.5);
    BOOST_TEST(least > 8); // 3 m from bumper to bumper
}

BOOST_AUTO_TEST_CASE(without_radar_echoes_it_brakes_after_all) {
    road all;
    all.radar = true;
    all.drive(1);
    all.silent = {"v1"};
    all.drive(1);
    BOOST_TEST((all.v2.mode() == role::radar));
    all.radar = false;
    all.drive(0.5);
    BOOST_TEST((all.v2.mode() == role::fallback));
}

BOOST_AUTO_TEST_CASE(an_update_that_comes_after_all_has_cost_next_to_nothing) {
    road all;
    all.drive(1);
    all.silent = {"v1"};
    all.drive(4 * period);
    BOOST_TEST((all.v2.mode() == role::fallback));
    all.silent.clear();
    all.drive(period);
    BOOST_TEST((all.v2.mode() == role::follow));
    BOOST_TEST(std::abs(all.v2.position().v - 25) < 0.01);
}

BOOST_AUTO_TEST_CASE(it_drops_what_no_vehicle_can_do_and_says_so_once) {
    road all;
    all.drive(1);
    std::vector<std::string> said;
    all.v2.on_drop = [&](double, const std::string& from, const std::string& why) {
        said.push_back(from + ": " + why);
    };
    all.v1.brake = -2.6;
    all.drive(2 * period);
    all.v0.j = NAN;
    all.drive(2 * period);
    BOOST_TEST(said.size() == 2U);
    BOOST_TEST(said[0] == "v1: brake is not positive");
    BOOST_TEST(std::abs(all.v2.command()) < 0.01);
    all.drive(4 * period); // dropped ones count as missing
    BOOST_TEST((all.v2.mode() == role::fallback));
}

BOOST_AUTO_TEST_CASE(an_old_vehicle_ahead_does_not_report_the_leader) {
    road all;
    all.drive(1.5);
    all.silent = {"v0"};
    all.v1.from_leader.reset();
    all.drive(2);
    const double without = all.v2.command();
    all.v1.from_leader = -1;
    all.drive(0.6);
    BOOST_TEST(std::abs(without) < 0.01);
    BOOST_TEST(all.v2.command() < -0.1);
}

/// v2's command at `after` seconds of silence of v1, which brakes although v0 does not.
double command_behind_one_that_brakes(double deceleration, double after) {
    road all;
    all.radar = true;
    all.drive(1.52);
    all.silent = {"v1"};
    all.v1.u = -deceleration;
    all.drive(after);
    return all.v2.command();
}

BOOST_AUTO_TEST_CASE(the_radar_overrules_what_was_inferred) {
    BOOST_TEST(command_behind_one_that_brakes(4, 1) < -2);
    BOOST_TEST(std::abs(command_behind_one_that_brakes(0, 1)) < 0.05);
}

// The radar always sees v1 `error` metres behind the place that it reports.
BOOST_AUTO_TEST_CASE(only_a_larger_error_refutes_what_was_inferred) {
    const auto command = [](double error) {
        road all;
        all.radar = true;
        all.radar_error = -error;
        all.drive(1.52);
        all.silent = {"v1"};
        all.drive(0.6);
        return all.v2.command();
    };
    BOOST_TEST(std::abs(command(0.29)) < 1e-3);
    BOOST_TEST(command(0.31) < -0.03);
}

BOOST_AUTO_TEST_CASE(what_becomes_of_the_one_beyond_does_not_jolt_it) {
    for (const auto& [mode, lead, behind, admits] : {std::tuple{role::follow, "v0", 30.0, ""},
                                                     {role::lead, "v1", 0.0, ""},
                                                     {role::follow, "v0", 15.0, "v9"},
                                                     {role::leave, "v0", 15.0, ""}}) {
        std::map<std::string, platoon::state> others{
            {"v0", {.mode = role::lead, .lead = "v0", .v = 25}},
            {"v1", {.mode = role::follow, .ahead = "v0", .lead = "v0", .behind = 15, .x = -15, .v = 25}},
            {"v2", {.mode = role::follow, .ahead = "v1", .lead = "v0", .behind = 30, .x = -30, .v = 25}}};
        platoon::driver v3{{.name = "v3", .ahead = "v2", .start = {.x = -45, .v = 25, .a = 0}}, 0};
        double most = 0;
        for (double now = 0; now < 1.6; now += period) {
            if (now > 1.48) {
                others["v1"].mode = mode;
                others["v1"].lead = lead;
                others["v1"].behind = behind;
                others["v1"].admits = admits;
            }
            for (auto& [name, each] : others) {
                each.t = now;
                each.x += now > 0 ? each.v * period : 0;
                if (name != "v2" || now < 1.48) {
                    v3.receive(name, each, now);
                }
            }
            v3.step(now);
            most = std::max(most, v3.mode() == role::fallback ? 0 : std::abs(v3.command()));
        }
        BOOST_TEST(most < 0.02, static_cast<int>(mode) << " " << behind << " " << admits);
    }
}

BOOST_AUTO_TEST_CASE(it_reports_what_saturated_actuators_can_do) {
    platoon::driver_setup setup{.name = "v1", .ahead = "v0", .start = {.x = -15, .v = 25, .a = 0}};
    setup.limits = {.lag = 0.6, .brake = 5};
    platoon::driver v1{setup, 0};
    platoon::state v0{.mode = role::lead, .lead = "v0", .v = 25, .a = -8, .u = -8};
    v0.x = -12; // far too near
    v1.receive("v0", v0, 0);
    v1.step(0);
    v1.step(0.01);
    BOOST_TEST(v1.command() == -5);
    const auto told = v1.report();
    BOOST_TEST(told.lag == 0.3);
    const auto truth = advance(v1.position(), v1.command(), 0.6, 0.02);
    BOOST_TEST(std::abs(advance(told.position(), told.u, told.lag, 0.02).a - truth.a) < 0.01);
}

BOOST_AUTO_TEST_CASE(without_the_leader_it_follows_the_one_ahead) {
    road all;
    all.v1.mode = role::degraded; // so that it does not report the leader's term either
    all.drive(1);
    all.silent = {"v0"};
    all.drive(4 * period);
    BOOST_TEST((all.v2.mode() == role::degraded));
    all.v0.u = -5; // unknown to it
    all.drive(2);
    BOOST_TEST((all.v2.mode() == role::degraded));
    BOOST_TEST(std::abs(all.v2.command()) < 0.01);
    BOOST_TEST(std::abs(all.v2.position().v - 25) < 0.01);
}

BOOST_AUTO_TEST_CASE(behind_one_that_falls_back_it_does_not_heed_the_leader) {
    road all;
    all.drive(1);
    all.v1.mode = role::fallback;
    all.v1.u = -4;
    all.drive(0.5);
    BOOST_TEST((all.v2.mode() == role::degraded));
    BOOST_TEST(all.v2.command() < -1);
    all.v1.lead = "v1"; // as the lead, it stops those behind
    all.v1.behind = 0;
    all.drive(0.5);
    BOOST_TEST((all.v2.mode() == role::follow));
    BOOST_TEST((all.v2.needed() == std::set<std::string>{"v1"}));
    BOOST_TEST(all.v2.report().lead == "v1");
    all.drive(10);
    BOOST_TEST(all.v2.position().v < 0.1);
    BOOST_TEST(all.v1.x - all.v2.position().x > 14);
}

BOOST_AUTO_TEST_CASE(when_the_one_ahead_leaves_it_follows_the_next_and_closes_up_slowly) {
    road all;
    all.drive(1);
    all.v1.mode = role::leave;
    all.drive(2 * period);
    BOOST_TEST((all.v2.needed() == std::set<std::string>{"v0"}));
    all.silent = {"v1"};
    double fastest = 0;
    for (int i = 0; i < 1000; ++i) {
        all.drive(period);
        fastest = std::max(fastest, all.v2.position().v);
    }
    BOOST_TEST((all.v2.mode() == role::follow));
    BOOST_TEST(fastest < 27.5);
    BOOST_TEST(std::abs(all.v0.x - period * 25 - all.v2.position().x - 15) < 0.05);
}

BOOST_AUTO_TEST_CASE(when_the_leader_leaves_the_next_one_leads) {
    platoon::driver v1{{.name = "v1", .ahead = "v0", .start = {.x = -15, .v = 25, .a = 0}}, 0};
    v1.receive("v0", {.mode = role::lead, .lead = "v0", .t = 0, .v = 25}, 0);
    v1.step(0.01);
    v1.receive("v0", {.mode = role::leave, .lead = "v0", .t = 0.04, .x = 1, .v = 25}, 0.04);
    v1.step(0.05);
    BOOST_TEST((v1.mode() == role::lead));
    BOOST_TEST(v1.needed().empty());
    BOOST_TEST(v1.report().lead == "v1");
    v1.step(20);
    BOOST_TEST(std::abs(v1.position().v - 25) < 0.1);
}

BOOST_AUTO_TEST_CASE(it_makes_room_for_one_that_merges_and_then_follows_it) {
    road all;
    all.drive(1);
    all.v1.admits = "v9";
    all.drive(period);
    BOOST_TEST(all.v2.needs("v9"));
    all.drive(14);
    BOOST_TEST(std::abs(all.v1.x - period * 25 - all.v2.position().x - 30) < 1);
    platoon::state v9{
        .mode = role::merge, .ahead = "v1", .lead = "v0", .behind = 30, .t = all.now, .x = all.v1.x - 15, .v = 25};
    all.v2.receive("v9", v9, all.now);
    BOOST_TEST(all.v2.ahead() == "v1");
    v9.mode = role::follow;
    v9.t += period;
    v9.x += period * 25;
    all.v2.receive("v9", v9, all.now);
    BOOST_TEST(all.v2.ahead() == "v9");
    BOOST_TEST(std::abs(all.v2.desired_distance() - 15) < 1);
}

BOOST_AUTO_TEST_CASE(one_that_splits_off_leads) {
    road all;
    all.radar = true;
    all.drive(1);
    all.v2.split();
    BOOST_TEST((all.v2.report().mode == role::lead));
    BOOST_TEST(all.v2.report().lead == "v2");
    BOOST_TEST(all.v2.needed().empty());
    all.drive(40);
    BOOST_TEST(std::abs(all.v1.x - period * 25 - all.v2.position().x - (5 + 5 + 1.5 * 25)) < 1);
}

BOOST_AUTO_TEST_CASE(behind_stronger_brakes_it_keeps_a_larger_distance) {
    BOOST_TEST(platoon::wanted_distance(15, 25, 8, 8) == 15);
    BOOST_TEST(platoon::wanted_distance(15, 25, 8, 5) == 15);
    BOOST_TEST(std::abs(platoon::wanted_distance(15, 25, 5, 8) - (15 + 625.0 / 10 - 625.0 / 16)) < 1e-9);
}

BOOST_AUTO_TEST_CASE(before_the_first_update_it_keeps_the_distance_that_the_radar_sees) {
    platoon::driver v1{{.name = "v1", .ahead = "v0", .start = {.x = 0, .v = 25, .a = 0}}, 0};
    BOOST_TEST(v1.desired_distance() == 15);
    v1.measure({.range = 10.2, .rate = 0}, 0); // only noise
    BOOST_TEST(v1.desired_distance() == 15);
    v1.measure({.range = 25, .rate = 0}, 0);
    BOOST_TEST(v1.desired_distance() == 30);
    v1.measure({.range = 4, .rate = 0}, 0);
    BOOST_TEST(v1.desired_distance() == 15);
}

BOOST_AUTO_TEST_CASE(where_nobody_is_ahead_after_all_it_brakes) {
    platoon::driver v1{{.name = "v1", .ahead = "v0", .start = {.x = 0, .v = 25, .a = 0}}, 0};
    std::string why;
    v1.on_change = [&](double, role, const std::string& said) { why = said; };
    double now = 0;
    for (; now < 0.99; now += 0.01) {
        v1.step(now);
        BOOST_TEST_REQUIRE((v1.mode() == role::follow));
    }
    for (; now < 12; now += 0.01) {
        v1.step(now);
    }
    BOOST_TEST((v1.mode() == role::fallback));
    BOOST_TEST(why == "v0 ahead was never received");
    BOOST_TEST(v1.position().v == 0);
}

BOOST_AUTO_TEST_SUITE_END()
