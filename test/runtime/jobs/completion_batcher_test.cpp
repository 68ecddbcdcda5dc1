// SPDX-License-Identifier: BSL-1.0
#include "jobs/completion_queue.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(completion_batcher)

using namespace std::chrono_literals;
using limits = cles::runtime::completion_batcher;

struct fixture {
    bool begin(const int& task, bool more = true, std::chrono::nanoseconds service_time = 1us) {
        return worker.begin_job(&task, more, service_time, now);
    }

    cles::runtime::completion_batcher worker;
    cles::time_point now{1h};
    int a = 0;
    int b = 0;
};

BOOST_FIXTURE_TEST_CASE(the_first_result_of_a_task_is_sent_at_once, fixture) {
    BOOST_TEST(!begin(a));
    BOOST_TEST(begin(a));
    BOOST_TEST(!begin(b));
    BOOST_TEST(!begin(a));
}

BOOST_FIXTURE_TEST_CASE(the_result_of_the_last_queued_job_is_sent_at_once, fixture) {
    begin(a);
    BOOST_TEST(!begin(a, false));
    BOOST_TEST(!worker.may_defer_before(&a));
}

BOOST_FIXTURE_TEST_CASE(long_jobs_are_not_deferred, fixture) {
    begin(a);
    BOOST_TEST(begin(a, true, limits::small_job - 1ns));
    BOOST_TEST(!begin(a, true, limits::small_job));
}

BOOST_FIXTURE_TEST_CASE(results_are_sent_before_a_job_of_another_task, fixture) {
    begin(a);
    begin(a);
    BOOST_TEST(worker.may_defer_before(&a));
    BOOST_TEST(!worker.may_defer_before(&b));
    BOOST_TEST(!worker.may_defer_before(nullptr));
}

BOOST_FIXTURE_TEST_CASE(results_are_deferred_briefly, fixture) {
    begin(a);
    begin(a);
    worker.deferred(now);
    now += limits::max_delay - 1ns;
    BOOST_TEST(begin(a));
    worker.deferred(now);
    now += 1ns;
    BOOST_TEST(!begin(a));
    BOOST_TEST(worker.flush());
    BOOST_TEST(!worker.flush());
    BOOST_TEST(begin(a));
}

BOOST_FIXTURE_TEST_CASE(few_results_are_deferred, fixture) {
    begin(a);
    for (unsigned i = 0; i < limits::max_deferred; ++i) {
        BOOST_TEST(begin(a));
        worker.deferred(now);
    }
    BOOST_TEST(!begin(a));
}

BOOST_AUTO_TEST_SUITE_END()
