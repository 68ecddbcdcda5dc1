// SPDX-License-Identifier: BSL-1.0
#include "jobs/completion_queue.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(streak)

using namespace std::chrono_literals;
using limits = cles::runtime::streak;

struct fixture {
    bool begin(const int& task, bool more = true, std::chrono::nanoseconds service_time = 1us) {
        return worker.begin(&task, more, service_time, now);
    }

    cles::runtime::streak worker;
    cles::time_point now{1h};
    int a = 0;
    int b = 0;
};

BOOST_FIXTURE_TEST_CASE(the_first_of_a_task_is_sent_at_once, fixture) {
    BOOST_TEST(!begin(a));
    BOOST_TEST(begin(a));
    BOOST_TEST(!begin(b));
    BOOST_TEST(!begin(a));
}

BOOST_FIXTURE_TEST_CASE(the_last_that_waits_is_sent_at_once, fixture) {
    begin(a);
    BOOST_TEST(!begin(a, false));
    BOOST_TEST(!worker.goes_on(&a));
}

BOOST_FIXTURE_TEST_CASE(long_jobs_keep_nothing_back, fixture) {
    begin(a);
    BOOST_TEST(begin(a, true, limits::small_job - 1ns));
    BOOST_TEST(!begin(a, true, limits::small_job));
}

BOOST_FIXTURE_TEST_CASE(before_a_job_of_another_task_or_none_all_are_sent, fixture) {
    begin(a);
    begin(a);
    BOOST_TEST(worker.goes_on(&a));
    BOOST_TEST(!worker.goes_on(&b));
    BOOST_TEST(!worker.goes_on(nullptr));
}

BOOST_FIXTURE_TEST_CASE(nothing_is_kept_for_long, fixture) {
    begin(a);
    begin(a);
    worker.keep(now);
    now += limits::longest_delay - 1ns;
    BOOST_TEST(begin(a));
    worker.keep(now);
    now += 1ns;
    BOOST_TEST(!begin(a));
    BOOST_TEST(worker.release());
    BOOST_TEST(!worker.release());
    BOOST_TEST(begin(a));
}

BOOST_FIXTURE_TEST_CASE(not_many_are_kept, fixture) {
    begin(a);
    for (unsigned i = 0; i < limits::most_kept; ++i) {
        BOOST_TEST(begin(a));
        worker.keep(now);
    }
    BOOST_TEST(!begin(a));
}

BOOST_AUTO_TEST_SUITE_END()
