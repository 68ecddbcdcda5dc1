// SPDX-License-Identifier: BSL-1.0
// What a strike aircraft refuses before it releases anything, and what it must not refuse.
#include "jadc2/vehicle_order.hpp"
#include "sgd/random_source.hpp"
#include "strike/release_rules.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace release_rules {
namespace {

using jadc2::test::order_for;
using strike::verdict;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double delay = 0.3; // s, from the track to the decision

double distance(const geo::plane_position& a, const geo::plane_position& b) {
    return std::hypot(a.east - b.east, a.north - b.north);
}

struct fixture {
    geo::traffic traffic{1};

    static strike::aircraft aircraft() {
        return {.limits = {},
                .state = strike::default_state(),
                .weapons = strike::magazine{4},
                .sensor = strike::own_sensor{1, strike::default_state().at}};
    }
    /// The vehicles near the middle, so that they have been on their road for long, that no other is near.
    [[nodiscard]] std::vector<geo::traffic::motion> alone(double utc) const {
        const auto all = traffic.at(utc);
        std::vector<geo::traffic::motion> out;
        for (const auto& one : all) {
            const auto near = std::count_if(all.begin(), all.end(),
                                            [&one](const auto& other) { return distance(one.at, other.at) < 25; });
            if (near == 1 && distance(one.at, {}) < 80) { // itself
                out.push_back(one);
            }
        }
        return out;
    }
    /// A good order against the first vehicle that is alone.
    [[nodiscard]] strike::order order() const {
        for (double utc = 700;; utc += 0.5) {
            if (const auto targets = alone(utc); !targets.empty()) {
                auto what = order_for(targets.front(), utc);
                what.until = utc + 10;
                return what;
            }
        }
    }
    /// One that is off by as much from each of two vehicles, of which either may be meant.
    [[nodiscard]] strike::order order_between() const {
        strike::order best;
        double least = infinity;
        for (double utc = 700; utc < 760; utc += 0.5) {
            const auto all = traffic.at(utc);
            for (std::size_t i = 1; i < all.size(); ++i) {
                const auto& a = all[i - 1];
                const auto& b = all[i];
                if (const double d = distance(a.at, b.at);
                    d < least && distance(a.at, {}) < 80 && distance(b.at, {}) < 80) {
                    least = d;
                    best =
                        order_for({.at = {.east = (a.at.east + b.at.east) / 2, .north = (a.at.north + b.at.north) / 2},
                                   .velocity = {.east = (a.velocity.east + b.velocity.east) / 2,
                                                .north = (a.velocity.north + b.velocity.north) / 2}},
                                  utc);
                }
            }
        }
        best.sigma = 8;
        best.sigma_v = 30;
        best.until = best.utc + 10;
        return best;
    }
};

struct refusal {
    const char* why;
    verdict kind;
    std::function<void(strike::order& what, strike::aircraft& own)> change;
};

// Moves the target to that place, on the plane of the traffic.
void move_to(strike::order& what, geo::plane_position place) {
    const auto at = geo::tangent_plane{geo::traffic::origin}.to_geographic(place);
    what.lat = at.lat;
    what.lon = at.lon;
}

void slow_down(strike::order& what, double by) {
    const double speed = std::hypot(what.ve, what.vn);
    what.ve *= (speed - by) / speed;
    what.vn *= (speed - by) / speed;
}

std::vector<refusal> refusals() {
    using strike::aircraft;
    using strike::order;
    constexpr auto wrong = verdict::wrong;
    constexpr auto refused = verdict::refused;
    return {
        {"id: ", wrong, [](order& what, aircraft&) { what.id = ""; }},
        {"id: ", wrong, [](order& what, aircraft&) { what.id = std::string(65, 'x'); }},
        {"ve, vn", wrong, [](order& what, aircraft&) { what.ve = nan; }},
        {"ve, vn", wrong, [](order& what, aircraft&) { what.vn = infinity; }},
        {"ve, vn", wrong, [](order& what, aircraft&) { what.utc = nan; }},
        {"ve, vn", wrong, [](order& what, aircraft&) { what.utc = -infinity; }},
        {"ve, vn", wrong, [](order& what, aircraft&) { what.until = nan; }},
        {"ve, vn", wrong, [](order& what, aircraft&) { what.until = infinity; }},
        {"lat and lon", wrong, [](order& what, aircraft&) { what.lat = 90; }},
        {"lat and lon", wrong, [](order& what, aircraft&) { what.lat = nan; }},
        {"lat and lon", wrong, [](order& what, aircraft&) { what.lon = 181; }},
        {"lat and lon", wrong, [](order& what, aircraft&) { what.lon = nan; }},
        {"sigma and", wrong, [](order& what, aircraft&) { what.sigma = 0; }},
        {"sigma and", wrong, [](order& what, aircraft&) { what.sigma = -3; }},
        {"sigma and", wrong, [](order& what, aircraft&) { what.sigma = 1001; }},
        {"sigma and", wrong, [](order& what, aircraft&) { what.sigma = nan; }},
        {"sigma and", wrong, [](order& what, aircraft&) { what.sigma_v = 0; }},
        {"sigma and", wrong, [](order& what, aircraft&) { what.sigma_v = 1001; }},
        {"sigma and", wrong, [](order& what, aircraft&) { what.sigma_v = nan; }},
        {"until: ", wrong, [](order& what, aircraft&) { what.until = what.utc + delay + 121; }},

        {"the order ended", refused, [](order& what, aircraft&) { what.until = what.utc + delay; }},
        {"the order ended", refused, [](order& what, aircraft&) { what.until = what.utc + delay - 1.5; }},
        {"the order ended", refused, [](order& what, aircraft&) { what.until = 0; }},
        {"the track is 2.1 s old: 2.0", refused, [](order& what, aircraft&) { what.utc -= 1.8; }},
        {"the track is 60.3 s old", refused, [](order& what, aircraft&) { what.utc -= 60; }},
        {"the track is -2.2 s old", refused, [](order& what, aircraft&) { what.utc += 2.5; }},
        {"the track is 0.3 s old: 0.1", refused, [](order&, aircraft& own) { own.limits.oldest_s = 0.1; }},

        {"the target's place", refused, [](order& what, aircraft&) { what.sigma = 1000; }},
        {"the target's place", refused, [](order& what, aircraft&) { what.sigma = 15.1; }},
        {"the target's place", refused, [](order& what, aircraft&) { what.sigma_v = 1000; }},
        {"the target's place", refused, [](order&, aircraft& own) { own.limits.widest_m = 1; }},
        {"the target's place", refused,
         [](order& what, aircraft&) {
             move_to(what, {.east = 0, .north = 2000});
             what.sigma = 1000;
         }},

        {"the target is ", refused, [](order& what, aircraft&) { what.lat += 1; }},
        {"the target is ", refused, [](order& what, aircraft&) { what.lat = -what.lat; }},
        {"the target is ", refused, [](order& what, aircraft&) { move_to(what, {.east = 0, .north = 5000}); }},
        {"the target is ", refused, [](order&, aircraft& own) { own.limits.range_m = 500; }},
        {"the weapon would fly", refused, [](order&, aircraft& own) { own.state.speed = 60; }},
        {"the weapon would fly", refused, [](order&, aircraft& own) { own.limits.flight_s = 0.5; }},
        {"the target is too fast", refused,
         [](order& what, aircraft& own) {
             own.state.scans = 0;
             what.ve = 5000;
         }},

        {"its own sensor sees no", refused, [](order& what, aircraft&) { move_to(what, {.east = 0, .north = 2000}); }},
        {"its own sensor sees no", refused,
         [](order& what, aircraft&) { // beside all roads
             const auto along = geo::traffic{1}.along();
             move_to(what, {.east = 100 * along.north, .north = -100 * along.east});
         }},
        {"its own sensor sees no", refused,
         [](order& what, aircraft&) {
             what.ve *= -5;
             what.vn *= -5;
         }},
        {"its own sensor sees no", refused, [](order& what, aircraft&) { slow_down(what, 9); }},
        {"no weapon is left", refused, [](order&, aircraft& own) { own.weapons = strike::magazine{0}; }},
        {"the order o1 has been carried out", verdict::failed,
         [](order& what, aircraft& own) { own.weapons.release(what.id); }},
    };
}

} // namespace
} // namespace release_rules

BOOST_FIXTURE_TEST_SUITE(release_rules, fixture)

BOOST_AUTO_TEST_CASE(what_must_be_refused) {
    const auto all = refusals();
    BOOST_TEST(all.size() >= 40U);
    const auto good = order();
    auto any = aircraft();
    BOOST_TEST_REQUIRE(strike::decide(good, good.utc + delay, any).why == "");
    for (std::size_t i = 0; i < all.size(); ++i) {
        BOOST_TEST_CONTEXT("row " << i << ": " << all[i].why) {
            auto own = aircraft();
            auto what = good;
            all[i].change(what, own);
            const auto decided = strike::decide(what, good.utc + delay, own);
            BOOST_TEST((decided.kind == all[i].kind));
            BOOST_TEST(decided.why.starts_with(all[i].why), decided.why);
        }
    }
}

BOOST_AUTO_TEST_CASE(one_that_may_mean_either_of_two_vehicles) {
    auto own = aircraft();
    const auto what = order_between();
    const auto decided = strike::decide(what, what.utc + delay, own);
    BOOST_TEST((decided.kind == verdict::refused));
    BOOST_TEST(decided.why == "its own sensor sees several targets there");
}

BOOST_AUTO_TEST_CASE(one_whose_vehicle_is_leaving_the_picture_is_not_refused) {
    auto own = aircraft();
    auto what = order();
    slow_down(what, 6); // the middle of the part that is still in sight moves more slowly
    BOOST_TEST(strike::decide(what, what.utc + delay, own).why == "");
}

BOOST_AUTO_TEST_CASE(what_must_not_be_refused) {
    auto own = aircraft();
    sgd::random_source chance{7};
    int asked = 0;
    for (double utc = 1000; asked < 200; utc += 0.7) {
        for (const auto& target : alone(utc)) {
            ++asked;
            auto what = order_for(target, utc, {.east = chance.within_one() * 3, .north = chance.within_one() * 3});
            what.ve += chance.within_one();
            what.vn += chance.within_one();
            const double now = utc + 0.1 * (asked % 15);
            what.until = now + (asked % 2 == 0 ? 0.001 : 100);
            const auto decided = strike::decide(what, now, own);
            BOOST_TEST((decided.kind == verdict::release), "order " << asked << ": " << decided.why);
            BOOST_TEST(distance(geo::tangent_plane{geo::traffic::origin}.to_plane(decided.at.at), target.at) < 150);
        }
    }
}

BOOST_AUTO_TEST_CASE(a_target_under_attack_is_not_attacked_again_without_a_word) {
    auto own = aircraft();
    const auto first = order();
    const double released = first.utc + delay;
    const auto decided = strike::decide(first, released, own);
    BOOST_TEST_REQUIRE((decided.kind == verdict::release));
    strike::release(first, decided, released, own);

    const auto before = traffic.at(first.utc);
    for (const double later : {0.5, 2.0, 4.0}) {
        const double utc = released + later;
        const auto all = traffic.at(utc);
        for (std::size_t i = 0; i < all.size(); ++i) {
            auto what = order_for(all[i], utc);
            what.id = "o2";
            what.until = utc + 10;
            const auto place = geo::tangent_plane{geo::traffic::origin}.to_plane({.lat = first.lat, .lon = first.lon});
            const bool same = distance(before[i].at, place) < 0.1;
            const auto second = strike::decide(what, utc, own);
            BOOST_TEST((second.kind == verdict::failed) == same, "vehicle " << i << ": " << second.why);
            if (same) {
                BOOST_TEST(second.why == "the target has been attacked by order o1: \"again\":true attacks it again");
                what.again = true;
                BOOST_TEST(strike::decide(what, utc, own).why == "");
            }
        }
    }
}

BOOST_AUTO_TEST_CASE(a_target_that_was_attacked_before_a_restart_is_known) {
    const auto first = order();
    auto own = aircraft();
    strike::remember(first, first.utc + delay, own);
    const double utc = first.utc + delay + 0.01;
    auto what = first;
    what.id = "o2";
    BOOST_TEST((strike::decide(what, utc, own).kind == verdict::failed));
}

BOOST_AUTO_TEST_CASE(the_target_of_an_order_that_is_held_is_followed) {
    auto own = aircraft();
    const auto what = order();
    const double came = what.utc + delay;
    const auto held = strike::decide(what, came, own);
    BOOST_TEST_REQUIRE((held.kind == verdict::release));
    strike::hold(what, held, came, own);
    const double later = came + 3; // its track is too old by then
    BOOST_TEST(strike::decide(what, later, own).why.starts_with("the track is"));
    const auto fresh = strike::follow_up(what, later, own);
    BOOST_TEST_REQUIRE(fresh.has_value());
    BOOST_TEST(fresh->id == what.id);
    const auto released = strike::decide(*fresh, later, own);
    BOOST_TEST(released.why == "");
    const auto truth = traffic.at(later + released.at.after_s);
    const auto place = geo::tangent_plane{geo::traffic::origin}.to_plane(released.at.at);
    BOOST_TEST(std::any_of(truth.begin(), truth.end(), [&](const auto& one) { return distance(one.at, place) < 5; }));

    own.state.scans = 0; // it sees nothing any more
    BOOST_TEST(!strike::follow_up(what, later + 60, own).has_value());
    BOOST_TEST(!strike::follow_up({.id = "o2"}, later, own).has_value());
}

BOOST_AUTO_TEST_CASE(one_that_is_not_seen_any_more_is_forgotten) {
    strike::engaged_targets all;
    const strike::target_filter target{{.east = 10, .north = 20}, {.east = 3, .north = 0}, 2, 1};
    all.add("o1", target, 100);
    BOOST_TEST(all.find(target, 100).value() == "o1");
    BOOST_TEST(all.scans_needed(100) == 0U);
    BOOST_TEST(all.scans_needed(102) == 20U);
    BOOST_TEST(all.scans_needed(1'000'000) == 600U);
    all.follow({}, 104.9);
    BOOST_TEST(all.find(target, 100).has_value());
    all.follow({}, 105.1);
    BOOST_TEST(!all.find(target, 100).has_value());
}

BOOST_AUTO_TEST_CASE(without_a_sensor_the_track_alone_decides) {
    auto own = aircraft();
    own.state.scans = 0;
    auto what = order();
    move_to(what, {.east = 0, .north = 2000});
    BOOST_TEST(strike::decide(what, what.utc + delay, own).why == "");
}

BOOST_AUTO_TEST_CASE(a_drill_needs_no_target) {
    auto own = aircraft();
    auto what = order();
    move_to(what, {.east = 0, .north = 2000});
    what.drill = true;
    BOOST_TEST(strike::decide(what, what.utc + delay, own).why == "");
    what.until = what.utc;
    BOOST_TEST(strike::decide(what, what.utc + delay, own).why.starts_with("the order ended"));
}

BOOST_AUTO_TEST_SUITE_END()
