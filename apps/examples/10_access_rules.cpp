// SPDX-License-Identifier: BSL-1.0
// One function decides who may do what. It gets the peer, the verb and the noun of every request that a link delivers.
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

#include <iostream>

// Everyone may read; only programs on this host, which connect by Unix socket or in process, may steer.
bool may(const cles::access& asked) {
    return asked.verb == cles::verb::pull || asked.verb == cles::verb::bind || asked.peer.transport != "tcp";
}

void attempt(cles::service& me, std::string_view command, const std::string& url) {
    try {
        std::cout << me.request(command, cles::call_options{}.at(url)) << '\n';
    } catch (const cles::error& failure) {
        std::cout << (failure.code() == cles::errc::denied ? "denied" : failure.what()) << '\n';
    }
}

int main() {
    boost::asio::io_context io;
    cles::service car{io, {.name = "car", .listen = {"tcp://127.0.0.1:0", "inproc://car"}, .authorise = may}};
    double angle = 0;
    car.on_pull("angle", [&] { return angle; });
    car.on_push("steer", [&](const cles::request& asked) { angle = asked.parameter<double>(0); });
    const auto tcp = car.endpoints().front();

    cles::service me{io, {.name = "me"}};
    attempt(me, "PULL car:angle", tcp);
    attempt(me, "PUSH car:steer/12.5", tcp);
    attempt(me, "PUSH car:steer/12.5", "inproc://car");
    attempt(me, "PULL car:angle", tcp);
}

// Prints:
// {"value":0}
// denied
// {}
// {"value":12.5}
