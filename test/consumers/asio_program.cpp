// SPDX-License-Identifier: BSL-1.0
// A program that also uses the classes of Asio that are compiled in the library: their constructors and destructors
// have to be there.
#include <cles/service.hpp>

#include <boost/asio.hpp>

#include <csignal>
#include <iostream>

namespace asio = boost::asio;

namespace {

asio::awaitable<void> ask(cles::service& car, cles::service& tower, double& speed) {
    asio::steady_timer pause{co_await asio::this_coro::executor, std::chrono::milliseconds{1}};
    co_await pause.async_wait(asio::use_awaitable);
    speed = co_await tower.async_pull<double>("car:speed");
    car.stop();
    tower.stop();
}

template <class Thrown, class... A>
bool is_thrown(const A&... arguments) {
    try {
        throw Thrown{arguments...};
    } catch (const std::exception&) {
        return true;
    }
}

} // namespace

int main() {
    asio::io_context io{1};
    int asked = 0;
    cles::service car{io, {.name = "car", .listen = {"tcp://127.0.0.1:0"}}};
    car.on_pull("speed", [&] {
        ++asked;
        return 27.5;
    });
    cles::service tower{asio::any_io_executor{asio::make_strand(io)},
                        {.name = "tower", .peers = {{"car", car.endpoints().front()}}}};
    double speed = 0;
    asio::co_spawn(tower.get_executor(), ask(car, tower, speed), asio::detached);
    io.run();

    asio::thread_pool pool{2};
    asio::post(asio::make_strand(pool), [&] { ++asked; });
    pool.join();

    // What is only constructed.
    asio::signal_set signals{io, SIGUSR1};
    asio::system_timer timer{io};
    asio::ip::tcp::resolver resolver{io};
    asio::ip::udp::socket socket{io};
    asio::serial_port port{io};
    asio::posix::stream_descriptor descriptor{io};
    asio::local::stream_protocol::endpoint local{"/none"};
    const asio::any_completion_executor none{nullptr};
    asio::cancellation_signal cancellation;
    const auto address = asio::ip::make_address("::1");
    const auto network = asio::ip::make_network_v4("10.0.0.0/8");
    const bool thrown = is_thrown<asio::service_already_exists>() && is_thrown<asio::invalid_service_owner>() &&
                        is_thrown<asio::execution::bad_executor>() && is_thrown<asio::bad_executor>() &&
                        is_thrown<asio::multiple_exceptions>(std::exception_ptr{});
    if (address.is_v6() && network.prefix_length() == 8 && thrown) {
        std::cout << asked << " asked, " << speed << '\n';
    }
}
