// SPDX-License-Identifier: BSL-1.0
// A host with a loop of its own (a control cycle, a game, a GUI) gives the service a turn in each round.
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

#include <iostream>
#include <thread>

using namespace std::chrono_literals;

int main() {
    boost::asio::io_context io;
    cles::service sensor{io, {.name = "sensor", .listen = {"tcp://127.0.0.1:0"}}};
    int round = 0;
    sensor.on_pull("round", [&] { return round; });
    cles::service me{io, {.name = "me", .peers = {{"sensor", sensor.endpoints().front()}}}};

    int seen = -1;
    me.async_pull<int>("sensor:round", [&](boost::system::error_code, int value) { seen = value; });

    auto next = std::chrono::steady_clock::now();
    while (seen < 0 && round < 1000) {
        ++round;   // the host's own work
        io.poll(); // runs what is ready, and returns at once
        next += 1ms;
        std::this_thread::sleep_until(next); // the rest of the cycle
    }
    std::cout << (seen > 0 && seen <= round ? "answered while the host's loop went on\n" : "no answer\n");
}

// Prints:
// answered while the host's loop went on
