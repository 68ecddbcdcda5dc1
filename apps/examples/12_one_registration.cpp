// SPDX-License-Identifier: BSL-1.0
// Tasks are registered with a registrar, of any kind: here the service of an application, and one made for a test.
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

#include <iostream>

struct leg {
    double km = 0, kmh = 0;
};
BOOST_DESCRIBE_STRUCT(leg, (), (km, kmh))

void register_tasks(cles::registrar& to) {
    to.on_delegate("minutes", [](const leg& l) { return l.km / l.kmh * 60; }, {.description = "Time for a leg"});
    to.on_pull("double", [](const cles::request& asked) { return 2 * asked.parameter<int>(0); }, {.parameters = {"n"}});
}

// What a test looks like: no socket, no port, no thread.
bool test_tasks() {
    boost::asio::io_context io;
    cles::service bench{io, {.name = "bench"}};
    register_tasks(bench);
    return bench.request("PULL self:double/21") == R"({"value":42})" &&
           bench.request(R"(DELEGATE self:minutes {"km":30,"kmh":60})") == R"({"value":30})";
}

int main() {
    std::cout << (test_tasks() ? "tested\n" : "the test failed\n");

    boost::asio::io_context io;
    cles::service car{io, {.name = "car", .listen = {"tcp://127.0.0.1:0"}}};
    register_tasks(car);
    cles::service me{io, {.name = "me", .peers = {{"car", car.endpoints().front()}}}};
    std::cout << me.request("PULL car:double/4") << '\n' << me.request("PULL car:cles") << '\n';
}

// Prints:
// tested
// {"value":8}
// {"node":"car",..."tasks":[...{"verb":"DELEGATE","task":"minutes","description":"Time for a leg"...
