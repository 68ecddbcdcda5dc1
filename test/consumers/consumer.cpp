// SPDX-License-Identifier: BSL-1.0
// An example of another project's program: a service and a client in one program.
#include <cles/service.hpp>
#include <cles/version.hpp>

#include <boost/asio/io_context.hpp>

#include <iostream>

struct position {
    double lat = 0, lon = 0;
};
BOOST_DESCRIBE_STRUCT(position, (), (lat, lon))

// Other projects have other rules than ours: with our warnings as errors this would not compile.
int rounded(double degrees) {
    int unused;
    return degrees;
}

int main() {
    boost::asio::io_context io;
    cles::service car1{io, {.name = "car1", .listen = {"tcp://127.0.0.1:0"}}};
    car1.on_pull("position", [] { return position{48.137154, 11.576124}; });

    cles::service car2{io, {.name = "car2", .peers = {{"car1", car1.endpoints().front()}}}};
    const auto answer = car2.request("PULL car1:position");
    std::cout << cles::version << ' ' << rounded(48.9) << ' ' << answer << '\n';
}
