// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/course.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <string>

namespace course {
namespace {

/// Two vehicles at 20 m/s, which are at the same place until `apart`, and then 15 m apart.
platoon::logbook parting(double apart) {
    platoon::logbook book;
    for (int i = 0; i <= 50; ++i) {
        const double t = i * 0.1;
        book.add("a", {.t = t, .x = 20 * t + (t < apart ? 0 : 15), .v = 20});
        book.add("b", {.t = t, .x = 20 * t, .v = 20});
    }
    return book;
}

} // namespace
} // namespace course

BOOST_AUTO_TEST_SUITE(course)

BOOST_AUTO_TEST_CASE(what_was_before_its_time_is_no_collision) {
    const auto book = ::course::parting(2);
    platoon::course_setup how{.first = {"a", "b"}, .desired = {0, 15}, .all = {"a", "b"}, .end = 5, .length = 5};
    how.recovery = INFINITY;
    BOOST_TEST(platoon::course_of(book, how).verdict.collision);
    how.from = how.begin = 3;
    const auto later = platoon::course_of(book, how);
    BOOST_TEST(!later.verdict.collision);
    BOOST_TEST(std::abs(later.verdict.least_gap - 10) < 1e-6);
    BOOST_TEST(later.t.front() == 3);
}

BOOST_AUTO_TEST_SUITE_END()
