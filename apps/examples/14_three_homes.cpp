// SPDX-License-Identifier: BSL-1.0
// One registration, unchanged, in three homes: this application's service, a test, and a plugin for clesd, which is
// three_homes/plugin.cpp and one line long.
#include <cles/service.hpp>

#include "three_homes/odometer.hpp"

#include <boost/asio/io_context.hpp>

#include <iostream>

// A test: no socket, no port, no thread.
bool test_odometer() {
    boost::asio::io_context io;
    cles::service bench{io, {.name = "bench"}};
    register_odometer(bench);
    return bench.request(R"(PUSH self:drive {"km":2})") == R"({"value":2})" &&
           bench.request(R"(DELEGATE self:there_and_back {"km":3})") == R"({"value":6})" &&
           bench.request(R"(PUSH self:drive {"km":1})") == R"({"value":6})";
}

int main() {
    std::cout << (test_odometer() ? "tested\n" : "the test failed\n");

    boost::asio::io_context io;
    cles::service car{io, {.name = "car", .listen = {"tcp://127.0.0.1:0"}}};
    register_odometer(car);
    cles::service me{io, {.name = "me", .peers = {{"car", car.endpoints().front()}}}};
    std::cout << me.request(R"(PUSH car:drive {"km":12.5})") << '\n'
              << me.request(R"(DELEGATE car:there_and_back {"km":7})") << '\n'
              << me.request("PULL car:cles") << '\n';
}

// Prints:
// tested
// {"value":12.5}
// {"value":14}
// {"node":"car",..."tasks":[...{"verb":"BIND","task":"odometer","description":"Kilometres driven"}...
