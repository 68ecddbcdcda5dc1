// SPDX-License-Identifier: BSL-1.0
#include "asio/asio_environment.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <ctime>
#include <memory>
#include <type_traits>

BOOST_AUTO_TEST_SUITE(boottime_timer)

using namespace std::chrono_literals;
using cles::time_point;

struct fixture {
    boost::asio::io_context io;
    int woken = 0;
    std::shared_ptr<cles::asio_port::boottime_timer> timer =
        std::make_shared<cles::asio_port::boottime_timer>(io.get_executor(), [this] { ++woken; });
};

BOOST_AUTO_TEST_CASE(deadlines_use_the_clock_that_continues_in_suspend) {
    static_assert(std::is_same_v<time_point::clock, cles::boottime_clock>);
    static_assert(!std::is_convertible_v<std::chrono::steady_clock::time_point, time_point>);
    std::timespec at{};
    boost::asio::io_context context;
    const cles::asio_port::asio_environment environment{context.get_executor()};
    const auto before = environment.now();
    BOOST_REQUIRE(::clock_gettime(CLOCK_BOOTTIME, &at) == 0);
    const auto after = environment.now();
    const time_point kernel{std::chrono::seconds{at.tv_sec} + std::chrono::nanoseconds{at.tv_nsec}};
    BOOST_TEST((before <= kernel && kernel <= after));
}

BOOST_FIXTURE_TEST_CASE(it_is_due_at_its_time_and_says_so_once, fixture) {
    const auto due = time_point::clock::now() + 20ms;
    timer->set(due);
    cles::test::run_until(io, [&] { return woken != 0; });
    BOOST_TEST((time_point::clock::now() >= due));
    cles::test::run_ready(io);
    BOOST_TEST(woken == 1);
}

BOOST_FIXTURE_TEST_CASE(a_time_that_is_over_is_due_at_once, fixture) {
    for (const auto at : {time_point{}, time_point{} - 1h, time_point::clock::now() - 1s}) {
        const auto before = woken;
        timer->set(at);
        cles::test::run_until(io, [&] { return woken > before; });
        BOOST_TEST(woken == before + 1);
    }
}

BOOST_FIXTURE_TEST_CASE(it_may_be_set_anew_while_somebody_waits, fixture) {
    timer->set(time_point::clock::now() + 1h);
    timer->set(time_point::clock::now() + 1ms);
    cles::test::run_until(io, [&] { return woken == 1; });
    timer->set(time_point::clock::now() + 1h);
    timer->stop();
    io.restart();
    BOOST_TEST(io.run() != 0U); // nothing waits any more
    BOOST_TEST(woken == 1);
}

BOOST_AUTO_TEST_SUITE_END()
