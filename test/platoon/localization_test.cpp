// SPDX-License-Identifier: BSL-1.0
#include "platoon/localization.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

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
                              .sent_ns = 7};
    const auto message = to_localization(told, start);
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
    BOOST_TEST(heard.from_leader == told.from_leader);
    BOOST_TEST(heard.lag == told.lag);
    BOOST_TEST(heard.brake == told.brake);
    BOOST_TEST(heard.sent_ns == told.sent_ns);
}

BOOST_AUTO_TEST_SUITE_END()
