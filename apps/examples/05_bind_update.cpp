// SPDX-License-Identifier: BSL-1.0
// A feed: it begins with the last value, reports gaps, and binds again when its publisher returns.
#include <cles/service.hpp>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>

#include <cstdint>
#include <exception>
#include <iostream>
#include <memory>

namespace asio = boost::asio;

// So that what a coroutine throws comes out of `io.run()`, instead of going unseen.
void rethrow(const std::exception_ptr& failure) {
    if (failure) {
        std::rethrow_exception(failure);
    }
}

std::unique_ptr<cles::service> start_car(const asio::any_io_executor& executor) {
    return std::make_unique<cles::service>(executor, cles::service_options{.name = "car", .listen = {"inproc://car"}});
}

void show(const cles::feed_item<double>& item) {
    switch (item.kind) {
    case cles::feed_event::current: std::cout << "current: " << item.value << '\n'; break;
    case cles::feed_event::update: std::cout << "update " << item.seq << ": " << item.value << '\n'; break;
    case cles::feed_event::gap: std::cout << item.missed << " missed\n"; break;
    case cles::feed_event::lost: std::cout << "the publisher is lost\n"; break;
    case cles::feed_event::rebound: std::cout << "the publisher is back\n"; break;
    }
}

asio::awaitable<void> follow(std::unique_ptr<cles::service> car, cles::service& me) {
    car->update("speed", 10.5);
    auto feed = co_await me.async_bind<double>("car:speed", cles::bind_options{}.keep(2));
    show(co_await feed.async_next());
    car->update("speed", 11.0);
    show(co_await feed.async_next());

    for (double speed = 12.0; speed <= 111.0; ++speed) {
        car->update("speed", speed); // far more than the two that are queued for this subscriber
    }
    std::uint64_t total = 0; // how many are read depends on the speed; missed ones are reported, the newest arrives
    for (double newest = 0.0; newest < 111.0;) {
        const auto item = co_await feed.async_next();
        total += item.kind == cles::feed_event::gap ? item.missed : 1;
        newest = item.value;
    }
    std::cout << total << " more, read or missed\n";

    car.reset();
    car = start_car(me.get_executor());
    car->update("speed", 0.0);
    for (int i = 0; i < 3; ++i) {
        show(co_await feed.async_next());
    }
    car->stop();
    me.stop();
}

int main() {
    asio::io_context io;
    cles::service me{io, {.name = "me", .peers = {{"car", "inproc://car"}}}};
    asio::co_spawn(io, follow(start_car(me.get_executor()), me), rethrow);
    io.run();
}

// Prints:
// current: 10.5
// update 2: 11
// 100 more, read or missed
// the publisher is lost
// the publisher is back
// current: 0
