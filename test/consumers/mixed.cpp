// SPDX-License-Identifier: BSL-1.0
// The part of a program that compiles Asio's functions itself, together with one that uses those of the library.
// Objects that they share must exist only once.
#include <cles/service.hpp>

#include "separate_part.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/io_context.hpp>

#include <csignal>
#include <iostream>

#if defined(BOOST_ASIO_SEPARATE_COMPILATION)
#error the property CLES_HEADER_ONLY_ASIO leaves BOOST_ASIO_SEPARATE_COMPILATION out
#endif

int main() {
    const bool one_category = &boost::asio::error::get_netdb_category() == &category_in_separate_part();

    boost::asio::io_context io;
    boost::asio::signal_set here{io, SIGUSR1};
    boost::asio::signal_set there{io};
    int seen = 0;
    here.async_wait([&](boost::system::error_code, int) { ++seen; });
    await_signal(there, SIGUSR1, [&] { ++seen; });
    std::raise(SIGUSR1);
    io.run();

    cles::service car{io, {.name = "car", .listen = {"tcp://127.0.0.1:0"}}};
    car.on_pull("speed", [] { return 27.5; });
    cles::service tower{io, {.name = "tower", .peers = {{"car", car.endpoints().front()}}}};
    io.restart();
    std::cout << (one_category ? "one category" : "two categories") << ", " << seen << " signals, "
              << tower.request("PULL car:speed") << '\n';
}
