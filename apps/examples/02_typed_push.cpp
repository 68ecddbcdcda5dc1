// SPDX-License-Identifier: BSL-1.0
// Structs are sent as JSON and received as structs. A body that does not fit is refused, with the path to the error.
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

struct point {
    double lat = 0, lon = 0;
    std::optional<std::string> name{}; // may be absent
};
BOOST_DESCRIBE_STRUCT(point, (), (lat, lon, name))

struct route {
    std::vector<point> points{};
};
BOOST_DESCRIBE_STRUCT(route, (), (points))

asio::awaitable<void> drive(cles::service& car, cles::service& planner) {
    const route home{{{48.1, 11.5, "start"}, {48.2, 11.6}}};
    const auto taken = co_await planner.async_push<int>("car:route", home);
    std::cout << "the car accepted " << taken << " points\n";

    try {
        co_await planner.async_request(
            R"(PUSH car:route {"points":[{"lat":48.1,"lon":11.5},{"lat":48.2,"lon":"east"}]})");
    } catch (const cles::error& refused) {
        std::cout << refused.what() << '\n';
    }
    car.stop();
    planner.stop();
}

int main() {
    asio::io_context io;
    cles::service car{io, {.name = "car", .listen = {"tcp://127.0.0.1:0"}}};
    car.on_push("route", [](const route& r) {
        std::cout << "from " << r.points.front().name.value_or("somewhere") << " to " << r.points.back().lat << '\n';
        return r.points.size();
    });

    cles::service planner{io, {.name = "planner", .peers = {{"car", car.endpoints().front()}}}};
    asio::co_spawn(io, drive(car, planner), rethrow);
    io.run();
}

// Prints:
// from start to 48.2
// the car accepted 2 points
// bad_request: car: the body is invalid: points[1].lon: expected a number, got a string (at byte ...)
