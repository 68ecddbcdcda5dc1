// SPDX-License-Identifier: BSL-1.0
#include "jobs/drain_operation.hpp"
#include "jobs/job_pool.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>

BOOST_AUTO_TEST_SUITE(drain_operation)

using namespace std::chrono_literals;
using cles::runtime::drain_report;

struct fixture {
    void begin(std::chrono::milliseconds limit) {
        drain.begin(
            limit,
            [this] {
                ++limits;
                drain.complete({.stuck = 1});
            },
            [this](const drain_report& how) {
                ++ends;
                stuck = how.stuck;
            });
    }

    boost::asio::io_context io;
    cles::runtime::drain_operation drain{io.get_executor()};
    int limits = 0;
    int ends = 0;
    std::size_t stuck = 0;
};

BOOST_FIXTURE_TEST_CASE(it_completes_with_the_last_job_and_cancels_its_timer, fixture) {
    BOOST_TEST(!drain.is_pending());
    begin(1h);
    BOOST_TEST(drain.is_pending());
    drain.complete({});
    BOOST_TEST(!drain.is_pending());
    io.run(); // returns, because the timer has been cancelled
    BOOST_TEST(ends == 1);
    BOOST_TEST(limits == 0);
}

BOOST_FIXTURE_TEST_CASE(it_completes_at_its_limit, fixture) {
    begin(0ms);
    io.run();
    BOOST_TEST(limits == 1);
    BOOST_TEST(ends == 1);
    BOOST_TEST(stuck == 1U);
    BOOST_TEST(!drain.is_pending());
}

BOOST_FIXTURE_TEST_CASE(a_cancelled_drain_calls_nothing, fixture) {
    begin(1h);
    drain.cancel();
    io.run();
    BOOST_TEST(!drain.is_pending());
    BOOST_TEST(ends + limits == 0);
}

BOOST_AUTO_TEST_SUITE_END()
