// SPDX-License-Identifier: BSL-1.0
// The last argument of an operation says how its result is wanted: as a callback, a future, or without exceptions.
#include <cles/service.hpp>

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/use_future.hpp>

#include <exception>
#include <iostream>

namespace asio = boost::asio;
using namespace std::chrono_literals;

// So that what a coroutine throws comes out of `io.run()`, instead of going unseen.
void rethrow(const std::exception_ptr& failure) {
    if (failure) {
        std::rethrow_exception(failure);
    }
}

asio::awaitable<void> without_exceptions(cles::service& me) {
    std::string words;
    const auto options = cles::call_options{}.diagnostics(words);
    const auto [code, value] = co_await me.async_pull<int>("car:gear", options, asio::as_tuple(asio::use_awaitable));
    std::cout << "tuple: " << (code == cles::errc::no_task ? "no_task" : "?") << ", " << words << '\n';
}

int main() {
    asio::io_context io;
    cles::service car{io, {.name = "car", .listen = {"tcp://127.0.0.1:0"}}};
    car.on_pull("speed", [] { return 27.5; });
    cles::service me{io, {.name = "me", .peers = {{"car", car.endpoints().front()}}}};

    me.async_pull<double>("car:speed", [](boost::system::error_code code, double speed) {
        std::cout << "callback: " << (code ? -1 : speed) << '\n';
    });

    std::future<double> later = me.async_pull<double>("car:speed", asio::use_future);
    while (later.wait_for(0s) != std::future_status::ready) {
        io.run_one(); // with the context run by a thread of its own, get() alone would do
    }
    std::cout << "future: " << later.get() << '\n';

    asio::co_spawn(io, without_exceptions(me), [&](const std::exception_ptr& failure) {
        car.stop();
        me.stop();
        rethrow(failure);
    });
    io.run();
}

// Prints:
// callback: 27.5
// future: 27.5
// tuple: no_task, car has no PULL 'gear'
