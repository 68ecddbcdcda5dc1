// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>

#include "platoon/driver/localization.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>

namespace localization {

// As versions before the minimum was enough read it.
struct older_message {
    platoon::role mode = platoon::role::follow;
    std::string ahead{}, lead{}, admits{};
    double behind = 0, utc = 0, lat = 0, lon = 0, v = 0, a = 0, u = 0, j = 0;
    std::optional<double> from_leader{};
    double lag = 0, brake = 0;
    std::int64_t sent_ns = 0;
};
BOOST_DESCRIBE_STRUCT(older_message, (),
                      (mode, ahead, lead, admits, behind, utc, lat, lon, v, a, u, j, from_leader, lag, brake, sent_ns))

namespace {

const std::string complete = R"({"mode":"follow","ahead":"v0","lead":"v0","admits":"","behind":15,"utc":1795000001,)"
                             R"("lat":48.137,"lon":11.575,"v":25,"a":0,"u":0,"j":0,"lag":0.3,"brake":8,"sent_ns":1})";

platoon::state received(const std::string& json) {
    return to_state(cles::from_json<platoon::state_message>(json), 1'795'000'000);
}

std::string replaced(const std::string& before, const std::string& after) {
    auto text = complete;
    return text.replace(text.find(before), before.size(), after);
}

} // namespace
} // namespace localization

BOOST_AUTO_TEST_SUITE(localization)

BOOST_AUTO_TEST_CASE(utc_and_a_place_on_earth_are_enough_for_a_vehicle) {
    const double start = 1'795'000'000;
    const platoon::state told{.mode = platoon::role::degraded,
                              .ahead = "v1",
                              .lead = "v0",
                              .admits = "v9",
                              .behind = 30,
                              .t = 12.34,
                              .x = 308.5,
                              .v = 24.5,
                              .a = -0.5,
                              .u = -1,
                              .j = 0.25,
                              .from_leader = -0.7,
                              .lag = 0.4,
                              .brake = 6,
                              .length = 16.5,
                              .sent_ns = 7};
    const auto message = to_message(told, start);
    BOOST_TEST(std::abs(message.utc - 1'795'000'012.34) < 1e-6);
    BOOST_TEST(std::abs(message.lat - 48.137) < 0.01);
    BOOST_TEST(message.lat > 48.137);
    BOOST_TEST(message.lon > 11.575);
    const auto heard = to_state(message, start + 2); // which starts two seconds later
    BOOST_TEST(std::abs(heard.t - 10.34) < 1e-6);
    BOOST_TEST(std::abs(heard.x - told.x) < 1e-6);
    BOOST_TEST((heard.mode == told.mode));
    BOOST_TEST(heard.ahead == told.ahead);
    BOOST_TEST(heard.lead == told.lead);
    BOOST_TEST(heard.admits == told.admits);
    BOOST_TEST(heard.behind == told.behind);
    BOOST_TEST(heard.v == told.v);
    BOOST_TEST(heard.a == told.a);
    BOOST_TEST(heard.u == told.u);
    BOOST_TEST(heard.j == told.j);
    BOOST_TEST((heard.from_leader == told.from_leader));
    BOOST_TEST(heard.lag == told.lag);
    BOOST_TEST(heard.brake == told.brake);
    BOOST_TEST(heard.length == told.length);
    BOOST_TEST(heard.tells_lead);
    BOOST_TEST(heard.sent_ns == told.sent_ns);
}

BOOST_AUTO_TEST_CASE(a_message_without_the_leaders_term_can_be_read) {
    const auto old = received(complete);
    BOOST_TEST(!old.from_leader);
    BOOST_TEST(platoon::implausible(old, {}) == "");
    BOOST_TEST(!received(replaced(R"("lag")", R"("from_leader":null,"lag")")).from_leader);
    BOOST_TEST(*received(replaced(R"("lag")", R"("from_leader":-0.5,"lag")")).from_leader == -0.5);
}

BOOST_AUTO_TEST_CASE(the_papers_minimum_is_enough) {
    const auto heard = received(R"({"utc":1795000002,"lat":48.137,"lon":11.575,"velocity":24,"acceleration":-1.5})");
    BOOST_TEST(platoon::implausible(heard, {}) == "");
    BOOST_TEST(heard.t == 2.0);
    BOOST_TEST(std::abs(heard.x) < 1e-6);
    BOOST_TEST(heard.v == 24.0);
    BOOST_TEST(heard.a == -1.5);
    BOOST_TEST(heard.u == -1.5); // it keeps its acceleration, as far as anybody knows
    BOOST_TEST(heard.j == 0.0);
    BOOST_TEST(!heard.tells_lead);
    BOOST_TEST((heard.mode == platoon::role::lead));
    BOOST_TEST(heard.length == 5.0);
    BOOST_TEST(heard.brake == 8.0);
    BOOST_TEST(heard.lag == 0.3);
    BOOST_TEST(platoon::implausible(received(R"({"utc":1795000002,"lat":48,"lon":11,"velocity":24})"), {}) != "");
    BOOST_TEST(platoon::implausible(received(R"({"utc":1795000002,"lat":48,"lon":11,"acceleration":0})"), {}) != "");
}

BOOST_AUTO_TEST_CASE(older_vehicles_and_new_ones_read_each_other) {
    const platoon::state told{.ahead = "v0", .lead = "v0", .behind = 15, .t = 1, .x = 20, .v = 24, .a = -0.5, .u = -1};
    const auto old = cles::from_json<older_message>(cles::to_json(to_message(told, 100)));
    BOOST_TEST(old.v == 24.0);
    BOOST_TEST(old.a == -0.5);
    BOOST_TEST(old.utc == 101.0);
    BOOST_TEST(old.lead == "v0");
    const auto back = to_state(cles::from_json<platoon::state_message>(cles::to_json(old)), 100);
    BOOST_TEST(back.v == 24.0);
    BOOST_TEST(back.u == -1.0);
    BOOST_TEST(back.length == 5.0);
    BOOST_TEST(back.tells_lead);
    const auto as_old = to_state(reduced(to_message(told, 100), platoon::dialect::older), 100);
    BOOST_TEST(as_old.v == 24.0);
    BOOST_TEST(as_old.tells_lead);
}

BOOST_AUTO_TEST_CASE(a_localization_is_the_minimum) {
    const auto message = platoon::to_message({.t = 1, .x = 20, .v = 24, .a = -0.5}, 100);
    const auto found = platoon::localization_of(message);
    BOOST_TEST(found.velocity == 24.0);
    BOOST_TEST(found.acceleration == -0.5);
    const auto heard = platoon::to_state(cles::from_json<platoon::state_message>(cles::to_json(found)), 100);
    BOOST_TEST(std::abs(heard.x - 20) < 1e-6);
    BOOST_TEST(!to_state(reduced(message, platoon::dialect::minimum), 100).tells_lead);
}

BOOST_AUTO_TEST_CASE(what_no_vehicle_can_do_is_implausible) {
    for (const std::string each : {R"("utc":1795000001)", R"("lat":48.137)", R"("lon":11.575)"}) {
        const auto name = each.substr(0, each.find(':') + 1);
        BOOST_TEST(platoon::implausible(received(replaced(each, name + "null")), {}) != "", name);
    }
    for (const std::string each : {R"("behind":15)", R"("utc":1795000001)", R"("v":25)", R"("a":0)", R"("u":0)",
                                   R"("j":0)", R"("lag":0.3)", R"("brake":8)"}) {
        const auto name = each.substr(0, each.find(':') + 1);
        BOOST_TEST(platoon::implausible(received(replaced(each, name + "1e300")), {}) != "", name);
        BOOST_TEST(platoon::implausible(received(replaced(each, name + "-1e300")), {}) != "", name);
    }
    for (const double brake : {0.0, -2.6, 21.0}) {
        BOOST_TEST(platoon::implausible({.brake = brake}, {}) != "", brake);
    }
    BOOST_TEST(platoon::implausible({.lag = 0}, {}) == "lag is not positive");
    BOOST_TEST(platoon::implausible({.length = 0}, {}) == "length is not positive");
    BOOST_TEST(platoon::implausible({.length = 101}, {}) != "");
    BOOST_TEST(platoon::implausible({.from_leader = 60}, {}) != "");
    BOOST_TEST(platoon::implausible({.from_leader = -30}, {}) == "");
    BOOST_TEST(platoon::implausible({.from_leader = std::numeric_limits<double>::quiet_NaN()}, {}) != "");
}

BOOST_AUTO_TEST_SUITE_END()
