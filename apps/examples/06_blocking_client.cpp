// SPDX-License-Identifier: BSL-1.0
// For a program without coroutines: each request runs the context itself until its answer is there.
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

#include <chrono>
#include <iostream>

using namespace std::chrono_literals;

struct battery {
    double volts = 0;
    int percent = 0;
};
BOOST_DESCRIBE_STRUCT(battery, (), (volts, percent))

int main() {
    boost::asio::io_context io;
    cles::service car{io, {.name = "car", .listen = {"tcp://127.0.0.1:0"}}};
    car.on_pull("battery", [] { return battery{12.6, 87}; });

    cles::service me{io, {.name = "me"}};
    me.set_peer("car", car.endpoints().front());

    const std::string json = me.request("PULL car:battery");
    std::cout << json << '\n' << cles::from_json<battery>(json).percent << " %\n";

    try {
        me.request("PULL car:speed", cles::call_options{}.deadline(500ms));
    } catch (const cles::error& failure) {
        std::cout << failure.code().message() << '\n' << failure.message() << '\n';
    }
}

// Prints:
// {"volts":12.6,"percent":87}
// 87 %
// the target does not offer that verb and task
// car has no PULL 'speed'
