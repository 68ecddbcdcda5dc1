// SPDX-License-Identifier: BSL-1.0
#include "asio/asio_environment.hpp"
#include "asio/boottime_timer.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <ctime>
#include <type_traits>

BOOST_AUTO_TEST_SUITE(boottime_timer)

using namespace std::chrono_literals;
using cles::time_point;

struct fixture {
    void wait() {
        timer.async_wait([this](boost::system::error_code code) { code ? ++cancelled : ++woken; });
    }
    boost::asio::io_context io;
    cles::asio_port::boottime_timer timer{io.get_executor()};
    int woken = 0;
    int cancelled = 0;
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
    timer.set(due);
    wait();
    BOOST_TEST(!timer.take());
    cles::test::run_until(io, [&] { return woken == 1; });
    BOOST_TEST((time_point::clock::now() >= due));
    BOOST_TEST(timer.take());
    BOOST_TEST(!timer.take());
}

BOOST_FIXTURE_TEST_CASE(a_time_that_is_over_is_due_at_once, fixture) {
    for (const auto at : {time_point{}, time_point{} - 1h, time_point::clock::now() - 1s}) {
        timer.set(at);
        wait();
        const auto before = woken;
        cles::test::run_until(io, [&] { return woken > before; });
        BOOST_TEST(timer.take());
    }
}

BOOST_FIXTURE_TEST_CASE(it_may_be_set_anew_while_somebody_waits, fixture) {
    timer.set(time_point::clock::now() + 1h);
    wait();
    timer.set(time_point::clock::now() + 1ms);
    cles::test::run_until(io, [&] { return woken == 1; });
    BOOST_TEST(timer.take());
    wait();
    timer.cancel();
    cles::test::run_until(io, [&] { return cancelled == 1; });
}

BOOST_AUTO_TEST_SUITE_END()
