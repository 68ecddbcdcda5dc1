// SPDX-License-Identifier: BSL-1.0
// Two cars exchange localization data: asked for once, then as a feed.
#include <cles/service.hpp>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>

#include <exception>
#include <iostream>

namespace asio = boost::asio;

// So that what a coroutine throws comes out of `io.run()`, instead of going unseen.
void rethrow(const std::exception_ptr& failure) {
    if (failure) {
        std::rethrow_exception(failure);
    }
}

struct localization {
    double utc = 0, lat = 0, lon = 0, velocity = 0, acceleration = 0;
};
BOOST_DESCRIBE_STRUCT(localization, (), (utc, lat, lon, velocity, acceleration))

localization here() { return {1790000000.5, 48.1371, 11.5754, 27.5, 0.3}; }

asio::awaitable<void> follow(cles::service& car1, cles::service& car2) {
    const auto fix = co_await car2.async_pull<localization>("car1:localization"); // once
    auto feed = co_await car2.async_bind<localization>("car1:localization");      // from now on
    const auto next = co_await feed.async_next();

    std::cout << "car1 is at " << fix.lat << ", " << fix.lon << '\n';
    std::cout << "car1 drives at " << next.value.velocity << " m/s\n";
    car1.stop();
    car2.stop();
}

int main() {
    asio::io_context io;
    cles::service car1{io, {.name = "car1", .listen = {"tcp://127.0.0.1:0"}}};
    car1.on_pull("localization", [] { return here(); });
    car1.update("localization", here()); // to all subscribers

    cles::service car2{io, {.name = "car2", .peers = {{"car1", car1.endpoints().front()}}}};
    asio::co_spawn(io, follow(car1, car2), rethrow);
    io.run();
}

// Prints:
// car1 is at 48.1371, 11.5754
// car1 drives at 27.5 m/s
