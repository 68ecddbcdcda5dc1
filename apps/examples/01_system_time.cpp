// SPDX-License-Identifier: BSL-1.0
// The paper's own example (section 3.3): device1 offers its time, and device2 asks for it in a time zone.
#include <cles/service.hpp>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>

#include <ctime>
#include <exception>
#include <iostream>

namespace asio = boost::asio;

// So that what a coroutine throws comes out of `io.run()`, instead of going unseen.
void rethrow(const std::exception_ptr& failure) {
    if (failure) {
        std::rethrow_exception(failure);
    }
}

struct system_time {
    std::string zone;
    std::int64_t seconds = 0; // since 1970
};
BOOST_DESCRIBE_STRUCT(system_time, (), (zone, seconds))

system_time get_system_time(const cles::request& asked) {
    const auto zone = asked.parameters().empty() ? "UTC" : asked.parameter(0);
    if (zone == "UTC") {
        return {"UTC", std::time(nullptr)};
    }
    if (zone == "TAI") {
        return {"TAI", std::time(nullptr) + 37};
    }
    throw cles::error(cles::errc::bad_request, "the zones are UTC and TAI");
}

asio::awaitable<void> compare(cles::service& device1, cles::service& device2) {
    const auto utc = co_await device2.async_pull<system_time>("device1:systemTime/UTC");
    const auto tai = co_await device2.async_pull<system_time>("device1:systemTime/TAI");
    const auto ahead = tai.seconds - utc.seconds;
    std::cout << tai.zone << " is ahead of " << utc.zone << (ahead == 37 || ahead == 38 ? " by 37 s\n" : "?\n");

    const auto answer = co_await device2.async_request("PULL device1:systemTime"); // as a command, in JSON
    std::cout << answer.text << '\n';
    device1.stop();
    device2.stop();
}

int main() {
    asio::io_context io;
    cles::service device1{io, {.name = "device1", .listen = {"tcp://127.0.0.1:0"}}};
    device1.on_pull("systemTime", get_system_time);

    cles::service device2{io, {.name = "device2", .peers = {{"device1", device1.endpoints().front()}}}};
    asio::co_spawn(io, compare(device1, device2), rethrow);
    io.run();
}

// Prints:
// TAI is ahead of UTC by 37 s
// {"zone":"UTC","seconds":...}
