// SPDX-License-Identifier: BSL-1.0
#include "jobs/service_time.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(service_time)

using namespace std::chrono_literals;

BOOST_AUTO_TEST_CASE(it_is_zero_at_first) { BOOST_TEST(cles::runtime::service_time{}.value().count() == 0); }

BOOST_AUTO_TEST_CASE(the_first_value_is_taken) {
    cles::runtime::service_time smoothed;
    smoothed.add(8ms, {});
    BOOST_TEST((smoothed.value() == 8ms));
}

BOOST_AUTO_TEST_CASE(each_further_value_weighs_an_eighth) {
    cles::runtime::service_time smoothed;
    smoothed.add(8ms, {});
    smoothed.add(16ms, {});
    BOOST_TEST((smoothed.value() == 9ms));
    smoothed.add(1ms, {});
    BOOST_TEST((smoothed.value() == 8ms));
}

BOOST_AUTO_TEST_CASE(it_converges) {
    cles::runtime::service_time smoothed;
    smoothed.add(1s, {});
    for (int i = 0; i < 100; ++i) {
        smoothed.add(1ms, {});
    }
    BOOST_TEST((smoothed.value() < 1100us));
    BOOST_TEST((smoothed.value() >= 1ms));
}

BOOST_AUTO_TEST_CASE(a_negative_duration_counts_as_zero) {
    cles::runtime::service_time smoothed;
    smoothed.add(-1s, {});
    BOOST_TEST(smoothed.value().count() == 0);
}

// A node that runs no jobs does not learn that they have become shorter.
BOOST_AUTO_TEST_CASE(it_is_recent_for_a_second) {
    cles::time_point now{1h};
    cles::runtime::service_time smoothed;
    BOOST_TEST(smoothed.recent(now).count() == 0);
    smoothed.add(8ms, now);
    now += 999ms;
    BOOST_TEST((smoothed.recent(now) == 8ms));
    now += 1ms;
    BOOST_TEST(smoothed.recent(now).count() == 0);
    BOOST_TEST((smoothed.value() == 8ms));
    smoothed.add(16ms, now);
    BOOST_TEST((smoothed.recent(now) == 9ms));
}

BOOST_AUTO_TEST_CASE(each_task_has_its_own) {
    const int shorter = 0;
    const int longer = 0;
    cles::runtime::task_times times;
    times.add(&shorter, 1ms, {});
    times.add(&longer, 1s, {});
    BOOST_TEST((times.of(&shorter) == 1ms));
    BOOST_TEST((times.of(&longer) == 1s));
    BOOST_TEST(times.of(&times).count() == 0);
}

BOOST_AUTO_TEST_SUITE_END()
