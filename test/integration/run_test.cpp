// SPDX-License-Identifier: BSL-1.0
// cles::run, which determines how a thread waits for work.

#include <cles/run.hpp>
#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/node.hpp"
#include "support/side_thread.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>

#include <sched.h>

BOOST_AUTO_TEST_SUITE(run)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;

constexpr std::array<std::chrono::microseconds, 2> bounds{0us, 50us};

CLES_DATA_TEST_CASE(ends_when_the_context_is_out_of_work, bounds, bound) {
    asio::io_context io;
    int ran = 0;
    asio::post(io, [&] { asio::post(io, [&] { ++ran; }); });
    BOOST_TEST(cles::run(io, {.busy_poll = bound}) == 2U);
    BOOST_TEST(ran == 1);
    BOOST_TEST(cles::run(io, {.busy_poll = bound}) == 0U); // stopped, until it is restarted
}

CLES_DATA_TEST_CASE(ends_when_the_context_is_stopped, bounds, bound) {
    asio::io_context io;
    const auto busy = asio::make_work_guard(io);
    asio::steady_timer timer{io, 20ms}; // longer than it polls for work
    timer.async_wait([&](boost::system::error_code) { io.stop(); });
    cles::run(io, {.busy_poll = bound});
    BOOST_TEST(io.stopped());
}

CLES_DATA_TEST_CASE(lets_out_what_a_handler_throws_and_goes_on_when_called_again, bounds, bound) {
    asio::io_context io;
    int ran = 0;
    asio::post(io, [] { throw std::runtime_error("a handler's"); });
    asio::post(io, [&] { ++ran; });
    BOOST_CHECK_THROW(cles::run(io, {.busy_poll = bound}), std::runtime_error);
    cles::run(io, {.busy_poll = bound});
    BOOST_TEST(ran == 1);
}

BOOST_AUTO_TEST_CASE(sets_the_requested_priority_and_restores_it) {
    asio::io_context io;
    int policy = -1;
    asio::post(io, [&] { policy = ::sched_getscheduler(0); });
    try {
        cles::run(io, {.fifo_priority = 1});
        BOOST_TEST(policy == SCHED_FIFO);
    } catch (const std::system_error& refused) {
        BOOST_TEST(policy == -1); // nothing ran
        BOOST_TEST((refused.code() == std::errc::operation_not_permitted));
        BOOST_TEST(std::string{refused.what()}.find("CAP_SYS_NICE") != std::string::npos);
    }
    BOOST_TEST(::sched_getscheduler(0) == SCHED_OTHER);
}

BOOST_AUTO_TEST_CASE(a_priority_that_does_not_exist_is_refused_before_anything_runs) {
    asio::io_context io;
    bool ran = false;
    asio::post(io, [&] { ran = true; });
    BOOST_CHECK_THROW(cles::run(io, {.fifo_priority = 1000}), cles::error);
    BOOST_TEST(!ran);
}

CLES_DATA_TEST_CASE(serves_a_peer, bounds, bound) {
    side_thread there;
    std::unique_ptr<cles::service> car;
    there.run([&] {
        car = std::make_unique<cles::service>(there.io(), listening("car1", carrier::tcp4));
        car->on_pull("speed", [n = 0]() mutable { return ++n; });
    });
    asio::io_context io;
    cles::service tower{io, knowing("tower", *car)};
    int last = 0;
    const std::function<void()> ask = [&] {
        tower.async_pull<int>("car1:speed", [&](boost::system::error_code code, int value) {
            BOOST_TEST(!code);
            last = value;
            if (code || value == 200) {
                tower.stop();
            } else {
                ask();
            }
        });
    };
    ask();
    cles::run(io, {.busy_poll = bound});
    BOOST_TEST(last == 200);
    there.run([&] { car.reset(); });
}

BOOST_AUTO_TEST_SUITE_END()
