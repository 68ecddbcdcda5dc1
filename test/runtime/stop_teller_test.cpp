// SPDX-License-Identifier: BSL-1.0
#include "job_record.hpp"
#include "stop_teller.hpp"
#include "support/gate.hpp"

#include <boost/test/unit_test.hpp>

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

BOOST_AUTO_TEST_SUITE(stop_teller)

using namespace std::chrono_literals;
using cles::runtime::job_context;
using cles::runtime::job_record;

// The test holds each job too, which is thus never given back.
job_context context_of(job_record& job) {
    job.add_reference();
    return job_context{job};
}

struct fixture {
    fixture() { job.add_reference(); }

    job_record job;
    cles::runtime::stop_teller teller;
};

BOOST_FIXTURE_TEST_CASE(jobs_are_told_one_after_another_on_one_other_thread, fixture) {
    std::atomic<int> told{0};
    std::atomic<bool> in_order{true};
    std::atomic<std::thread::id> where{};
    for (int i = 0; i < 10; ++i) {
        teller.tell(context_of(job), [&, i] {
            in_order = in_order && told == i;
            where = std::this_thread::get_id();
            ++told;
        });
    }
    while (told != 10) {
        std::this_thread::yield();
    }
    BOOST_TEST(in_order);
    BOOST_TEST((where.load() != std::this_thread::get_id()));
    BOOST_TEST(teller.end(1min) == 0U);
}

BOOST_FIXTURE_TEST_CASE(where_nobody_was_told_there_is_nothing_to_end, fixture) { BOOST_TEST(teller.end(0ms) == 0U); }

BOOST_AUTO_TEST_CASE(all_are_told_before_the_end_also_where_the_thread_has_hardly_begun) {
    for (int i = 0; i < 50; ++i) {
        static job_record job;
        job.add_reference();
        std::atomic<int> told{0};
        cles::runtime::stop_teller teller;
        teller.tell(context_of(job), [&] { ++told; });
        teller.tell(context_of(job), [&] { ++told; });
        BOOST_TEST(teller.end(i % 2 == 0 ? 1min : 0ms) == 0U);
        BOOST_TEST(told == 2);
    }
}

BOOST_AUTO_TEST_CASE(who_has_not_been_told_at_the_end_is_let_go_of) {
    static job_record job; // its thread lets go of it at some time after the test
    job.add_reference();
    const auto held = std::make_shared<cles::test::gate>();
    cles::runtime::stop_teller teller;
    teller.tell(context_of(job), [held] { held->pass(); });
    while (held->arrived() == 0) {
        std::this_thread::yield();
    }
    const auto token = std::make_shared<int>(0);
    teller.tell(context_of(job), [token] {});
    BOOST_TEST(token.use_count() == 2);
    BOOST_TEST(teller.end(0ms) == 1U);
    BOOST_TEST(token.use_count() == 1);
    held->open();
    while (held->passed() == 0) {
        std::this_thread::yield();
    }
}

BOOST_AUTO_TEST_CASE(a_job_that_does_not_return_from_it_is_left_behind) {
    static job_record job; // its thread lets go of it at some time after the test
    job.add_reference();
    const auto held = std::make_shared<cles::test::gate>();
    cles::runtime::stop_teller teller;
    teller.tell(context_of(job), [held] { held->pass(); });
    while (held->arrived() == 0) {
        std::this_thread::yield();
    }
    BOOST_TEST(teller.end(0ms) == 1U);
    held->open();
    while (held->passed() == 0) { // it still finds what it needs
        std::this_thread::yield();
    }
}

BOOST_AUTO_TEST_SUITE_END()
