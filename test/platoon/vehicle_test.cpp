// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/vehicle.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace vehicle {
namespace {

using names = std::set<std::string>;

platoon::vehicle_setup setup_of(const std::string& name, const std::string& ahead, bool separate_truth = false) {
    platoon::vehicle_setup setup{.separate_truth = separate_truth};
    setup.driving.name = name;
    setup.driving.ahead = ahead;
    setup.driving.start = {.x = 0, .v = 25, .a = 0};
    return setup;
}

platoon::state_message told_by(const std::string& ahead, const std::string& leader, double t, double x) {
    return platoon::to_message({.ahead = ahead, .lead = leader, .behind = 15, .t = t, .x = x, .v = 25}, 0);
}

struct driving {
    explicit driving(platoon::vehicle_setup setup) : who(std::move(setup)) { who.begin(who.setup().driving, 0); }

    /// \return how many updates it publishes
    int until(double t) {
        int updates = 0;
        while (who.next() <= t) {
            updates += who.decide() ? 1 : 0;
        }
        return updates;
    }

    platoon::vehicle who;
};

} // namespace
} // namespace vehicle

BOOST_AUTO_TEST_SUITE(vehicle)

BOOST_AUTO_TEST_CASE(publishes_at_its_rate_in_its_part_of_the_period) {
    auto setup = setup_of("v1", "v0");
    setup.turn = 1;
    setup.turns = 4;
    driving one{std::move(setup)};
    double at = 0;
    std::optional<platoon::state_message> update;
    while (!update) {
        at = one.who.next();
        update = one.who.decide();
    }
    BOOST_TEST(std::abs(at - 0.01) < 1e-9);
    BOOST_TEST((update->ahead == "v0"));
    BOOST_TEST(one.until(2) == 49);
    BOOST_TEST(one.who.report().sent == 50U);
}

BOOST_AUTO_TEST_CASE(binds_what_it_hears_of) {
    driving one{setup_of("v2", "v1")};
    one.until(0.1);
    BOOST_TEST((one.who.bound_to() == names{"v1"}));
    BOOST_TEST(one.who.receive("v1", told_by("v0", "v0", 0.1, 15), 0.1, false));
    BOOST_TEST((one.who.bound_to() == names{"v0", "v1"}));
    BOOST_TEST(one.who.is_bound_to("v0"));
    BOOST_TEST(!one.who.is_bound_to("v9"));
    BOOST_TEST(one.who.seen() == "v1");
}

BOOST_AUTO_TEST_CASE(a_false_clock_does_not_change_how_it_drives) {
    const auto driven = [](std::optional<double> utc) {
        driving one{setup_of("v1", "v0")};
        for (double t = 0; t < 3; t += 0.04) {
            one.until(t);
            one.who.receive("v0", told_by("", "v0", t, 15 + 25 * t), t, false);
            if (utc) {
                one.who.note_clock("v0", t, *utc, t);
            }
        }
        return one.who.who()->position().x;
    };
    const double expected = driven(std::nullopt);
    BOOST_TEST(std::isfinite(expected));
    for (const double utc : {std::nan(""), 3600.0, -3600.0, 1e308, -HUGE_VAL}) {
        BOOST_TEST(driven(utc) == expected, utc);
    }
}

BOOST_AUTO_TEST_CASE(who_has_no_clock_is_seldom_asked) {
    driving one{setup_of("v1", "v0")};
    one.until(0.1);
    BOOST_TEST((one.who.clocks_to_ask(0.1) == names{"v0"}));
    BOOST_TEST(one.who.clocks_to_ask(0.2).empty());
    BOOST_TEST((one.who.clocks_to_ask(0.4) == names{"v0"})); // it has not answered
    one.who.note_no_clock("v0", 0.5);
    BOOST_TEST(one.who.clocks_to_ask(10).empty());
    BOOST_TEST((one.who.clocks_to_ask(11) == names{"v0"}));
    one.who.note_clock("v0", 11, 11, 11);
    BOOST_TEST((one.who.clocks_to_ask(11.5) == names{"v0"}));
}

BOOST_AUTO_TEST_CASE(counts_what_arrives_and_what_its_node_reports_as_missing) {
    driving one{setup_of("v1", "v0")};
    one.until(0.1);
    BOOST_TEST(!one.who.receive("v0", told_by("", "v0", 0.1, 15), 0.1, true));   // was repeated
    BOOST_TEST(!one.who.receive("v0", told_by("", "v0", -0.5, 0), 0.11, false)); // before the drive
    BOOST_TEST(one.who.receive("v0", told_by("", "v0", 0.11, 15.2), 0.12, false));
    one.who.note_gap(3, -0.1);
    one.who.note_gap(2, 0.1);
    BOOST_TEST(one.who.report().received == 1U);
    BOOST_TEST(one.who.report().missed == 2U);
}

BOOST_AUTO_TEST_CASE(its_radar_sees_true_positions_alone) {
    for (const bool separate : {false, true}) {
        driving one{setup_of("v1", "v0", separate)};
        one.until(0.5);
        one.who.receive("v0", told_by("", "v0", 0.5, 27.5), 0.5, false);
        for (double t = 0.5; t < 3; t += 0.04) { // from now on it receives nothing
            if (separate) {
                one.who.see("v0", told_by("", "v0", t, 15 + 25 * t));
            }
            one.until(t);
        }
        BOOST_TEST((one.who.who()->mode() == platoon::role::radar), separate);
        BOOST_TEST((one.who.bound_to() == names{"v0"}), separate);
        // Without a link of its own, the radar sees a vehicle whose process has ended, and which therefore brakes.
        BOOST_TEST((one.who.who()->position().v < 24) == !separate, separate);
    }
}

BOOST_AUTO_TEST_CASE(one_follower_joins_at_a_time) {
    driving one{setup_of("v0", "")};
    one.until(1);
    BOOST_TEST(one.who.accept_follower({.name = "v1"}, 1) == "");
    BOOST_TEST(one.who.accept_follower({.name = "v1"}, 2) == "");
    BOOST_TEST(one.who.accept_follower({.name = "v2"}, 3) == "v1 is joining behind v0");
    BOOST_TEST(one.who.accept_follower({.name = "v2"}, 8) == "");
    BOOST_TEST(one.who.accept_follower({.name = "v3", .merges = true}, 14) == "");
    BOOST_TEST(one.who.accept_follower({.name = "v4", .merges = true}, 20) == "v3 is merging behind v0");
    one.who.leave(21);
    BOOST_TEST(one.who.accept_follower({.name = "v5"}, 21) == "v0 is about to leave, or has not started yet");
    BOOST_TEST(!one.who.has_left(21.5));
    BOOST_TEST(one.who.has_left(22));
}

BOOST_AUTO_TEST_CASE(splits_off_only_with_a_radar) {
    driving one{setup_of("v1", "v0")};
    BOOST_TEST(one.who.split() == "");
    BOOST_TEST((one.who.who()->mode() == platoon::role::lead));
    auto blind = setup_of("v1", "v0");
    blind.driving.radar.fitted = false;
    BOOST_TEST(driving{std::move(blind)}.who.split() == "v1 has no radar to keep a distance by");
}

BOOST_AUTO_TEST_CASE(tells_what_happens) {
    driving one{setup_of("v1", "v0")};
    std::string told;
    one.who.on_note = [&told](const platoon::event& what) { told += what.mode + " "; };
    one.until(2);
    BOOST_TEST(told == "fallback "); // nobody is ahead
    BOOST_TEST(one.who.report().events.size() == 1U);
}

BOOST_AUTO_TEST_CASE(joins_behind_the_last_one) {
    platoon::known_vehicles heard{{"v0", {.lead = "v0", .t = 1, .x = 100, .v = 25}},
                                  {"v1", {.ahead = "v0", .lead = "v0", .t = 1, .x = 85, .v = 25}}};
    BOOST_TEST(platoon::last_vehicle({}) == "");
    BOOST_TEST(platoon::last_vehicle(heard) == "v1");
    const auto at_end = platoon::setup_behind("v1", false, heard, {}, 2);
    BOOST_TEST(at_end.ahead == "v1");
    BOOST_TEST(at_end.start.x == 85 + 25 - 40);
    const auto between = platoon::setup_behind("v0", true, heard, {}, 2);
    BOOST_TEST(between.merges);
    BOOST_TEST(between.before == "v1");
    BOOST_TEST(between.start.x == 100 + 25 - 15);
}

BOOST_AUTO_TEST_SUITE_END()
