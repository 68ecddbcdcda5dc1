// SPDX-License-Identifier: BSL-1.0
#include "core/ended_runs.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(ended_runs)

using namespace std::chrono_literals;

namespace {

const cles::time_point start{1h};

cles::core::ended_runs::run until(cles::time_point when, std::uint64_t seq = 5) {
    return {.node = "car1", .seq = seq, .at = start, .until = when, .farewell = true, .news = 1};
}

} // namespace

BOOST_AUTO_TEST_CASE(what_was_said_before_the_end_is_covered) {
    cles::core::ended_runs ended{4};
    ended.add(7, until(start + 15s), start);
    BOOST_TEST(ended.covers("car1", 7, 4));
    BOOST_TEST(ended.covers("car1", 7, 5));
    BOOST_TEST(!ended.covers("car1", 7, 6)); // it has not ended after all
    BOOST_TEST(!ended.covers("car1", 8, 4));
    BOOST_TEST(ended.covers("car1", 7, 0));  // without a number nobody can tell
    BOOST_TEST(!ended.covers("car2", 7, 4)); // of the same epoch by chance
    ended.forget(7);
    BOOST_TEST(!ended.covers("car1", 7, 4));
}

BOOST_AUTO_TEST_CASE(they_are_bounded_and_the_one_that_matters_least_goes_first) {
    cles::core::ended_runs ended{2};
    ended.add(1, until(start + 5s), start);
    ended.add(2, until(start + 3s), start);
    ended.add(3, until(start + 9s), start);
    BOOST_TEST(ended.covers("car1", 1, 1));
    BOOST_TEST(!ended.covers("car1", 2, 1));
    BOOST_TEST(ended.covers("car1", 3, 1));
    ended.add(4, until(start + 20s), start + 10s); // all others are over
    BOOST_TEST(ended.all().size() == 1U);
}

BOOST_AUTO_TEST_CASE(where_there_is_no_room_nothing_is_kept) {
    cles::core::ended_runs ended{0};
    ended.add(1, until(start + 5s), start);
    BOOST_TEST(ended.all().empty());
}

BOOST_AUTO_TEST_SUITE_END()
