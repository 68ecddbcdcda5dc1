// SPDX-License-Identifier: BSL-1.0
// The smallest useful service: one task, typed, on one thread. It shows what a small device needs for a node.
//
//     cles_minimal [URL]      listens on tcp://127.0.0.1:25370 without a URL
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

#include <cstdio>
#include <exception>

struct position {
    double lat;
    double lon;
};
BOOST_DESCRIBE_STRUCT(position, (), (lat, lon))

int main(int argc, char** argv) {
    try {
        boost::asio::io_context io{1};
        cles::service car{io, {.name = "car1", .listen = {argc > 1 ? argv[1] : "tcp://127.0.0.1:25370"}}};
        car.on_pull("position", [] { return position{48.137154, 11.576124}; });
        std::puts(car.endpoints().front().c_str());
        std::fflush(stdout);
        io.run();
        return 0;
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "cles_minimal: %s\n", failure.what());
        return 1;
    }
}
