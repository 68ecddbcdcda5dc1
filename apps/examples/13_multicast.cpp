// SPDX-License-Identifier: BSL-1.0
// Multicast: publishers of a task are found without an address, and one datagram serves all that are bound.
#include <cles/service.hpp>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>

#include <cstdint>
#include <exception>
#include <iostream>
#include <map>
#include <string>

namespace asio = boost::asio;

// So that what a coroutine throws comes out of `io.run()`, instead of going unseen.
void rethrow(const std::exception_ptr& failure) {
    if (failure) {
        std::rethrow_exception(failure);
    }
}

// The port of the group. It is 25370 unless something else is said; this example takes one that is free, so that it is
// alone there.
std::uint16_t free_port() {
    asio::io_context io;
    const asio::ip::udp::socket probe{io, {asio::ip::udp::v4(), 0}};
    return probe.local_endpoint().port();
}

cles::service_options in_group(const std::string& name, std::uint16_t port) {
    cles::service_options options{.name = name};
    options.multicast.interface = "lo"; // another interface needs `insecure`, as listening does
    options.multicast.port = port;
    return options;
}

asio::awaitable<void> listen_to(cles::service& tower, cles::service& car1, cles::service& car2) {
    std::map<std::string, double> speeds;
    auto feed = co_await tower.async_bind<double>("all:speed");
    while (speeds.size() < 2) { // what each published last comes soon
        const auto item = co_await feed.async_next();
        speeds[item.publisher] = item.value;
    }
    for (const auto& [name, speed] : speeds) {
        std::cout << name << " drives at " << speed << '\n';
    }
    car1.update("speed", 11.5);
    const auto item = co_await feed.async_next();
    std::cout << item.publisher << " drives at " << item.value << " (update " << item.seq << ")\n";
    for (auto* node : {&tower, &car1, &car2}) {
        node->stop();
    }
}

int main() {
    asio::io_context io;
    const auto port = free_port();
    cles::service car1{io, in_group("car1", port)};
    cles::service car2{io, in_group("car2", port)};
    cles::service tower{io, in_group("tower", port)};
    car1.update("speed", 10.5);
    car2.update("speed", 20.5);
    asio::co_spawn(io, listen_to(tower, car1, car2), rethrow);
    io.run();
}

// Prints:
// car1 drives at 10.5
// car2 drives at 20.5
// car1 drives at 11.5 (update 2)
