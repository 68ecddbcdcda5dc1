// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "geo/traffic.hpp"
#include "jadc2/vehicle_order.hpp"
#include "strike/order.hpp"
#include "strike/tasks.hpp"
#include "support/answer.hpp"
#include "support/asked_node.hpp"
#include "support/temporary_folder.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>

namespace strike_tasks {
namespace {

const geo::geographic here{.lat = 48, .lon = 11};
const geo::tangent_plane plane{here};

double now() { return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count(); }

struct fixture : cles::test::asked_node {
    fixture() { strike::register_tasks(node, settings()); }

    [[nodiscard]] strike::settings settings() const {
        return {.weapons = 2,
                .lat = here.lat,
                .lon = here.lon,
                .height = 0,
                .speed = 100,
                .oldest_s = 60,
                .scans = 0,
                .ledger = (folder / "orders").string()};
    }
    std::string give(const strike::order& what) { return ask("DELEGATE self:strike " + cles::to_json(what)); }
    static strike::order order(const std::string& id) {
        const auto at = plane.to_geographic({.east = 300, .north = 400});
        const double utc = now();
        return {.id = id, .lat = at.lat, .lon = at.lon, .sigma = 3, .sigma_v = 1, .utc = utc, .until = utc + 60};
    }
    /// Against another target, which is elsewhere.
    static strike::order other_order(const std::string& id) {
        auto what = order(id);
        what.lat -= 0.005;
        return what;
    }
    static geo::plane_position aim(const strike::outcome& out) {
        return plane.to_plane({.lat = out.aim_lat, .lon = out.aim_lon});
    }

    cles::test::temporary_folder folder{"cles-strike"};
};

} // namespace
} // namespace strike_tasks

BOOST_FIXTURE_TEST_SUITE(strike_tasks, fixture)

BOOST_AUTO_TEST_CASE(its_jobs_stay_on_this_node) {
    BOOST_TEST(ask("PULL self:cles").find("\"local\":true") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(an_order_is_carried_out) {
    const auto before = now();
    const auto out = cles::from_json<strike::outcome>(give(order("o1")));
    BOOST_TEST(out.node == "node");
    BOOST_TEST(out.order == "o1");
    BOOST_TEST(std::hypot(aim(out).east - 300, aim(out).north - 400) < 1e-3);
    BOOST_TEST(std::abs(out.flight_s - 5) < 1e-6);
    BOOST_TEST(out.impact_utc >= before + 4.999);
    BOOST_TEST(out.plots == 0U);
    BOOST_TEST(out.sigma > 3);
    BOOST_TEST(out.left == 1U);
    BOOST_TEST(out.run_ms > 0);
    BOOST_TEST(ask("PULL self:strike") == R"({"left":1,"orders":["o1"]})");
}

BOOST_AUTO_TEST_CASE(it_is_aimed_at_where_the_target_will_be) {
    auto what = order("o1");
    what.ve = 20;
    what.utc -= 10; // the time since it was seen there
    const auto out = cles::from_json<strike::outcome>(give(what));
    BOOST_TEST(std::abs(aim(out).east - (300 + 20 * (10 + out.flight_s))) < 2); // the time that this takes
    BOOST_TEST(std::abs(std::hypot(aim(out).east, aim(out).north) - 100 * out.flight_s) < 1e-3);
}

BOOST_AUTO_TEST_CASE(what_its_own_sensor_sees_is_fused) {
    cles::test::asked_node there; // near the traffic, as it is by default
    strike::register_tasks(there.node, {.oldest_s = 60});
    const double utc = now();
    const auto all = geo::traffic{1}.at(utc);
    const auto target = *std::min_element(all.begin(), all.end(), [](const auto& a, const auto& b) {
        return std::hypot(a.at.east, a.at.north) < std::hypot(b.at.east, b.at.north); // so that it stays on its road
    });
    auto what = jadc2::test::order_for(target, utc);
    what.until = utc + 60;
    const auto out = cles::from_json<strike::outcome>(there.ask("DELEGATE self:strike " + cles::to_json(what)));
    BOOST_TEST(out.plots > 10U);
    BOOST_TEST(out.sigma < 2);
}

BOOST_AUTO_TEST_CASE(no_order_is_carried_out_twice) {
    give(order("o1"));
    BOOST_TEST(give(order("o1")) == "failed: node: the order o1 has been carried out already");
    BOOST_TEST(ask("PULL self:strike") == R"({"left":1,"orders":["o1"]})");
}

BOOST_AUTO_TEST_CASE(no_target_is_attacked_twice_without_a_word) {
    give(order("o1"));
    BOOST_TEST(give(order("o2")) ==
               R"(failed: node: the target has been attacked by order o1: "again":true attacks it again)");
    auto again = order("o3");
    again.again = true;
    BOOST_TEST(cles::from_json<strike::outcome>(give(again)).left == 0U);
}

BOOST_AUTO_TEST_CASE(what_was_carried_out_before_a_restart_is_known) {
    const auto at = (folder / "others").string();
    auto aircraft = settings();
    aircraft.ledger = at;
    const auto first = cles::to_json(order("o1"));
    {
        cles::test::asked_node there;
        strike::register_tasks(there.node, aircraft);
        there.ask("DELEGATE self:strike " + first);
    }
    cles::test::asked_node there;
    strike::register_tasks(there.node, aircraft);
    BOOST_TEST(there.ask("DELEGATE self:strike " + first) == "failed: node: the order o1 has been carried out already");
    BOOST_TEST(
        there.ask("DELEGATE self:strike " + cles::to_json(order("o2"))).starts_with("failed: node: the target has"));
    BOOST_TEST(there.ask("PULL self:strike") == R"({"left":1,"orders":["o1"]})");
}

BOOST_AUTO_TEST_CASE(without_a_ledger_a_track_from_before_the_start_is_not_struck) {
    auto aircraft = settings();
    aircraft.ledger.reset();
    const auto before = cles::to_json(order("o1"));
    cles::test::asked_node there;
    strike::register_tasks(there.node, aircraft);
    BOOST_TEST(there.ask("DELEGATE self:strike " + before) ==
               "busy: node: the track is older than the start of this aircraft, which has no ledger");
    BOOST_TEST(cles::from_json<strike::outcome>(there.ask("DELEGATE self:strike " + cles::to_json(order("o1")))).left ==
               1U);
}

BOOST_AUTO_TEST_CASE(a_ledger_that_cannot_be_used) {
    cles::test::asked_node there;
    auto aircraft = settings();
    aircraft.ledger = (folder / "missing/orders").string();
    BOOST_CHECK_THROW(strike::register_tasks(there.node, aircraft), cles::error);
}

BOOST_AUTO_TEST_CASE(without_a_weapon_it_is_for_another) {
    give(order("o1"));
    give(other_order("o2"));
    auto third = other_order("o3");
    third.lat -= 0.005;
    BOOST_TEST(give(third) == "busy: node: no weapon is left");
    BOOST_TEST(ask("PULL self:strike") == R"({"left":0,"orders":["o1","o2"]})");
}

BOOST_AUTO_TEST_CASE(a_drill_is_all_but_the_release) {
    auto what = order("o1");
    what.drill = true;
    BOOST_TEST(std::abs(cles::from_json<strike::outcome>(give(what)).flight_s - 5) < 1e-6);
    BOOST_TEST(cles::from_json<strike::outcome>(give(what)).left == 2U);
    BOOST_TEST(ask("PULL self:strike") == R"({"left":2,"orders":[]})");
}

BOOST_AUTO_TEST_CASE(what_cannot_be_is_refused) {
    auto what = order("");
    BOOST_TEST(give(what) == "bad_request: node: id: 1 to 64 characters");
    what = order("o1");
    what.vn = std::numeric_limits<double>::infinity();
    BOOST_TEST(give(what) == "bad_request: node: ve, vn, utc and until: numbers");
    what = order("o1");
    what.lat = 90;
    BOOST_TEST(give(what) == "bad_request: node: lat and lon: degrees, -89 to 89 and -180 to 180");
    what = order("o1");
    what.sigma = 0;
    BOOST_TEST(give(what) == "bad_request: node: sigma and sigma_v: more than 0, 1000 at most");
    what = order("o1");
    what.utc -= 100;
    BOOST_TEST(give(what).starts_with("busy: node: the track is 100."));
    what.utc += 200;
    BOOST_TEST(give(what).starts_with("busy: node: the track is -"));
    what = order("o1");
    what.ve = 1000;
    BOOST_TEST(give(what) == "busy: node: the target is too fast");
    BOOST_TEST(ask("PULL self:strike") == R"({"left":2,"orders":[]})");
}

BOOST_AUTO_TEST_CASE(orders_that_must_be_signed) {
    cles::test::asked_node there; // which has no key
    strike::register_tasks(there.node, {.must_be_signed = true});
    BOOST_TEST(there.ask("DELEGATE self:strike " + cles::to_json(order("o1"))) ==
               "denied: node: 'strike' requires signed requests, and this node has no security");
    BOOST_TEST(there.ask("PULL self:strike") == R"({"left":4,"orders":[]})");
}

BOOST_AUTO_TEST_CASE(orders_that_a_second_member_must_confirm) {
    auto aircraft = settings();
    aircraft.ledger.reset();
    aircraft.must_be_confirmed = true;
    cles::test::asked_node there; // without security, so that nobody can
    strike::register_tasks(there.node, aircraft);
    BOOST_TEST(there.ask("DELEGATE self:strike " + cles::to_json(order("o1")))
                   .starts_with("denied: node: orders must be confirmed"));
    BOOST_TEST(there.ask("PULL self:strike") == R"({"left":2,"orders":[]})");
    auto drill = order("o2");
    drill.drill = true;
    BOOST_TEST(cles::from_json<strike::outcome>(there.ask("DELEGATE self:strike " + cles::to_json(drill))).left == 2U);
}

BOOST_AUTO_TEST_CASE(words_on_orders_that_are_not_held) {
    BOOST_TEST(ask(R"(PUSH self:strike {"order":"o1","say":"confirm"})") == "failed: node: no order o1 is held");
    BOOST_TEST(ask(R"(PUSH self:strike {"order":"o1","say":"abort"})") == "failed: node: no order o1 is held");
    BOOST_TEST(ask(R"(PUSH self:strike {"order":"o1","say":"yes"})") == "bad_request: node: say: confirm or abort");
}

BOOST_AUTO_TEST_CASE(settings_that_cannot_be) {
    for (const auto& wrong :
         {strike::settings{.weapons = 1001}, strike::settings{.speed = 0}, strike::settings{.oldest_s = -1},
          strike::settings{.lat = std::numeric_limits<double>::quiet_NaN()}, strike::settings{.lon = 181},
          strike::settings{.height = -1}, strike::settings{.scans = 31}, strike::settings{.range_m = 0},
          strike::settings{.flight_s = -1}, strike::settings{.widest_m = std::numeric_limits<double>::infinity()}}) {
        boost::asio::io_context other;
        cles::service there{other, {.name = "there"}};
        BOOST_CHECK_THROW(strike::register_tasks(there, wrong), cles::error);
    }
}

BOOST_AUTO_TEST_SUITE_END()
