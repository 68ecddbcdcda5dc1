// SPDX-License-Identifier: BSL-1.0
// The paper's localization exchange (section 4.1) by CLES, a complete program. icd_localization.cpp is the same by
// hand.
//
//     cles_localization server --port PORT      answers on loopback; port 0: the system's choice, which it prints
//     cles_localization client HOST:PORT        asks once for each line of its input; ends with 1 at the first failure
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

#include <cstdio>
#include <ctime>
#include <iostream>
#include <stdexcept>
#include <string>

using namespace std::literals;

struct localization {
    double utc, lat, lon, velocity, acceleration;
};
BOOST_DESCRIBE_STRUCT(localization, (), (utc, lat, lon, velocity, acceleration))

localization measure() { return {static_cast<double>(std::time(nullptr)), 48.137154, 11.576124, 27.31, -0.12}; }

int main(int argc, char* argv[]) try {
    const bool serves = argc == 4 && argv[1] == "server"s && argv[2] == "--port"s;
    if (!serves && (argc != 3 || argv[1] != "client"s)) {
        throw std::invalid_argument("usage: cles_localization server --port PORT | client HOST:PORT");
    }
    boost::asio::io_context io;
    cles::service node{io, {.name = "localization"}};
    if (serves) {
        node.on_pull("localization", measure);
        std::cout << "listening on " << node.listen("tcp://127.0.0.1:"s + argv[3]) << std::endl;
        io.run();
    }
    const auto how = cles::call_options{}.at("tcp://"s + argv[2]).deadline(1s);
    for (std::string line; std::getline(std::cin, line);) {
        io.poll(); // notices that a link was lost, and reconnects
        const auto at = cles::from_json<localization>(node.request("PULL self:localization", how));
        std::printf("%.0f %.6f %.6f %.2f %.2f\n", at.utc, at.lat, at.lon, at.velocity, at.acceleration);
        std::fflush(stdout);
    }
} catch (const std::exception& failure) {
    std::cerr << "cles_localization: " << failure.what() << '\n';
    return 1;
}
