// SPDX-License-Identifier: BSL-1.0
// A shared library, such as a component of ROS or a module of Python, which contains CLES and does not show it.
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

extern "C" {

bool my_library_knows_denied(const boost::system::error_code& code) { return code == cles::errc::denied; }

void my_library_throws_denied() { throw cles::error{cles::errc::denied, "from the library"}; }

double my_library_serves() {
    boost::asio::io_context io;
    cles::service car{io, {.name = "car", .listen = {"tcp://127.0.0.1:0"}}};
    car.on_pull("speed", [] { return 27.5; });
    cles::service tower{io, {.name = "tower", .peers = {{"car", car.endpoints().front()}}}};
    double speed = 0;
    tower.async_pull<double>("car:speed", [&](boost::system::error_code, double found) {
        speed = found;
        car.stop();
        tower.stop();
    });
    io.run();
    return speed;
}

} // extern "C"
