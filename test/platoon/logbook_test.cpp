// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/logbook.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

namespace logbook {
namespace {

platoon::state told(double t, double x, double v) { return {.t = t, .x = x, .v = v}; }

} // namespace
} // namespace logbook

BOOST_AUTO_TEST_SUITE(logbook)

BOOST_AUTO_TEST_CASE(between_two_updates_it_knows_where_a_vehicle_was, *boost::unit_test::tolerance(1e-9)) {
    platoon::logbook book;
    const auto x = [](double t) { return 3 + 20 * t - 2 * t * t + t * t * t; };
    const auto v = [](double t) { return 20 - 4 * t + 3 * t * t; };
    book.add("v1", told(1, x(1), v(1)));
    book.add("v1", told(1.1, x(1.1), v(1.1)));
    BOOST_TEST(book.position("v1", 1.03)->x == x(1.03));
    BOOST_TEST(book.position("v1", 1.03)->v == v(1.03));
    BOOST_TEST(!book.position("v1", 0.9));
    BOOST_TEST(!book.position("v2", 1));
}

BOOST_AUTO_TEST_CASE(it_has_the_last_minutes_of_a_vehicle) {
    platoon::logbook book;
    for (int i = 0; i <= 4'000; ++i) {
        book.add("v1", told(i, 20.0 * i, 20));
    }
    BOOST_TEST(!book.position("v1", 2'000));
    BOOST_TEST(book.position("v1", 4'000 - platoon::logbook::longest).has_value());
    book.add("v1", told(4'000.001, 0, 20)); // no vehicle sends so fast
    BOOST_TEST(book.last("v1")->t == 4'000);
    book.forget("v1");
    BOOST_TEST((book.last("v1") == nullptr));
}

BOOST_AUTO_TEST_CASE(one_that_was_killed_brakes_and_one_that_left_is_not_there) {
    platoon::logbook book;
    book.add("v1", told(1, 0, 20));
    book.add("v2", told(1, -15, 20));
    BOOST_TEST(std::abs(book.position("v1", 3)->v - 20) < 1e-9);
    book.record_end("v1", false);
    book.record_end("v2", true);
    BOOST_TEST(std::abs(book.position("v1", 3)->v - 14.9) < 0.02);
    BOOST_TEST(!book.position("v2", 3));
    BOOST_TEST(book.position("v2", 1).has_value() == false);
    BOOST_TEST(book.has_left("v2"));
    BOOST_TEST(!book.has_left("v1"));
}

BOOST_AUTO_TEST_CASE(one_that_merges_is_not_in_the_lane_before) {
    platoon::logbook book;
    auto merging = told(1, 0, 20);
    merging.mode = platoon::role::merge;
    book.add("v1", merging);
    book.add("v1", told(2, 20, 20));
    BOOST_TEST(!book.position("v1", 1.5));
    BOOST_TEST(book.position("v1", 2.5)->x == 30);
}

BOOST_AUTO_TEST_CASE(without_a_driver_a_vehicle_moves_as_in_the_simulation, *boost::unit_test::tolerance(1e-9)) {
    platoon::logbook book;
    const platoon::state last{.t = 1, .x = 0, .v = 20, .a = -2, .u = -5};
    book.add("v1", last);
    book.record_end("v1", false);
    BOOST_TEST(book.position("v1", 1.5)->v == without_driver(last, 1.5).v);
    BOOST_TEST(without_driver(last, 1.5).v == advance(last.position(), -5, last.lag, 0.5).v);
}

BOOST_AUTO_TEST_SUITE_END()
