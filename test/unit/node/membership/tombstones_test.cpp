// SPDX-License-Identifier: BSL-1.0
#include "node/membership/incarnation.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(tombstones)

using namespace std::chrono_literals;

namespace {

const cles::time_point start{1h};

cles::core::tombstones::entry until(cles::time_point when, std::uint64_t seq = 5) {
    return {.node = "car1", .seq = seq, .at = start, .until = when, .graceful = true, .revision = 1};
}

} // namespace

BOOST_AUTO_TEST_CASE(announcements_before_the_end_are_covered) {
    cles::core::tombstones ended{4};
    ended.add(7, until(start + 15s), start);
    BOOST_TEST(ended.covers("car1", 7, 4));
    BOOST_TEST(ended.covers("car1", 7, 5));
    BOOST_TEST(!ended.covers("car1", 7, 6)); // it is alive after all
    BOOST_TEST(!ended.covers("car1", 8, 4));
    BOOST_TEST(ended.covers("car1", 7, 0));  // without a `seq` it cannot be excluded
    BOOST_TEST(!ended.covers("car2", 7, 4)); // the same epoch by chance
    ended.forget(7);
    BOOST_TEST(!ended.covers("car1", 7, 4));
}

BOOST_AUTO_TEST_CASE(tombstones_are_bounded_and_the_first_to_expire_is_dropped) {
    cles::core::tombstones ended{2};
    ended.add(1, until(start + 5s), start);
    ended.add(2, until(start + 3s), start);
    ended.add(3, until(start + 9s), start);
    BOOST_TEST(ended.covers("car1", 1, 1));
    BOOST_TEST(!ended.covers("car1", 2, 1));
    BOOST_TEST(ended.covers("car1", 3, 1));
    ended.add(4, until(start + 20s), start + 10s); // all others have expired
    BOOST_TEST(ended.all().size() == 1U);
}

BOOST_AUTO_TEST_CASE(nothing_is_kept_with_a_limit_of_zero) {
    cles::core::tombstones ended{0};
    ended.add(1, until(start + 5s), start);
    BOOST_TEST(ended.all().empty());
}

BOOST_AUTO_TEST_SUITE_END()
