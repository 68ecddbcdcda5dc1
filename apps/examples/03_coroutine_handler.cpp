// SPDX-License-Identifier: BSL-1.0
// A handler that waits is a coroutine. It is cancelled when the requester withdraws or its time runs out.
#include <cles/service.hpp>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>

#include <iostream>

namespace asio = boost::asio;
using namespace std::chrono_literals;

int stopped = 0;

asio::awaitable<int> warm_up(cles::request asked) { // by value: it outlives the caller's copy
    asio::steady_timer timer{co_await asio::this_coro::executor, asked.parameter<int>(0) * 1ms};
    try {
        co_await timer.async_wait(asio::use_awaitable);
    } catch (const boost::system::system_error&) {
        ++stopped; // the place to bring the device back to rest
        throw;
    }
    co_return 80;
}

asio::awaitable<void> use(cles::service& me, asio::cancellation_signal& impatience) {
    const cles::json_text nothing;
    const auto degrees = co_await me.async_delegate<int>("heater:warmUp/20", nothing);
    std::cout << "warm: " << degrees << " degrees\n";
    try {
        co_await me.async_delegate("heater:warmUp/60000", nothing, cles::call_options{}.deadline(50ms));
    } catch (const cles::error& late) {
        std::cout << (late.code() == cles::errc::deadline ? "too late\n" : late.what());
    }
    asio::steady_timer patience{me.get_executor(), 50ms};
    patience.async_wait([&](auto) { impatience.emit(asio::cancellation_type::terminal); });
    co_await me.async_delegate("heater:warmUp/60000", nothing);
}

int main() {
    asio::io_context io;
    cles::service heater{io, {.name = "heater", .listen = {"tcp://127.0.0.1:0"}}};
    heater.on_delegate("warmUp", warm_up, {.description = "Warms up for that many milliseconds", .parameters = {"ms"}});

    cles::service me{io, {.name = "me", .peers = {{"heater", heater.endpoints().front()}}}};
    asio::cancellation_signal impatience;
    asio::co_spawn(io, use(me, impatience),
                   asio::bind_cancellation_slot(impatience.slot(), [&](const std::exception_ptr& withdrawn) {
                       std::cout << (withdrawn ? "withdrawn\n" : "finished\n");
                       me.stop();
                       heater.stop();
                   }));
    io.run();
    std::cout << "handlers told to stop: " << stopped << '\n';
}

// Prints:
// warm: 80 degrees
// too late
// withdrawn
// handlers told to stop: 2
