// SPDX-License-Identifier: BSL-1.0
// Modules of one program communicate as nodes do, without sockets: a service with itself, with others on its context by
// their names, and with others in the process by an inproc URL.
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

#include <iostream>

int main() {
    boost::asio::io_context io;
    cles::service car{io, {.name = "car", .listen = {"inproc://car"}}};
    car.on_pull("where", [](const cles::request& asked) { return "asked by " + asked.peer().transport; });

    std::cout << car.request("PULL self:where") << '\n';
    std::cout << car.request("PULL car:where") << '\n';

    cles::service navigation{io, {.name = "navigation"}};
    std::cout << navigation.request("PULL car:where") << '\n';

    boost::asio::io_context other; // may be run by another thread
    cles::service radio{other, {.name = "radio", .peers = {{"car", "inproc://car"}}}};
    int answers = 0;
    radio.async_pull<std::string>("car:where", [&](boost::system::error_code, const std::string& text) {
        std::cout << text << '\n';
        ++answers;
    });
    while (answers == 0) {
        other.poll();
        io.poll();
    }
}

// Prints:
// {"value":"asked by inproc"}
// {"value":"asked by inproc"}
// {"value":"asked by inproc"}
// asked by inproc
