// SPDX-License-Identifier: BSL-1.0
// A long task reports how far it is. It takes a responder, the right to answer later.
#include <cles/service.hpp>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include <exception>
#include <iostream>

namespace asio = boost::asio;
using namespace std::chrono_literals;

// So that what a coroutine throws comes out of `io.run()`, instead of going unseen.
void rethrow(const std::exception_ptr& failure) {
    if (failure) {
        std::rethrow_exception(failure);
    }
}

struct scan {
    int frames = 0;
};
BOOST_DESCRIBE_STRUCT(scan, (), (frames))

asio::awaitable<void> take_frames(scan order, cles::responder answer) {
    asio::steady_timer shutter{answer.get_executor()};
    for (int taken = 1; taken <= order.frames && !answer.stopped(); ++taken) {
        shutter.expires_after(2ms);
        co_await shutter.async_wait(asio::use_awaitable);
        answer.progress(double(taken) / order.frames, scan{taken});
    }
    answer.done(order); // ignored if the requester no longer waits
}

asio::awaitable<void> watch(cles::service& camera, cles::service& me) {
    auto options = cles::call_options{}.on_progress([](double fraction, std::string_view details) {
        std::cout << static_cast<int>(fraction * 100) << " % " << details << '\n';
    });
    const scan order{4};
    const auto done = co_await me.async_delegate<scan>("camera:scan", order, options);
    std::cout << "done: " << done.frames << " frames\n";
    camera.stop();
    me.stop();
}

int main() {
    asio::io_context io;
    cles::service camera{io, {.name = "camera", .listen = {"tcp://127.0.0.1:0"}}};
    camera.on_delegate("scan", [](const cles::request& asked, cles::responder answer) {
        const auto executor = answer.get_executor();
        asio::co_spawn(executor, take_frames(asked.as<scan>(), std::move(answer)), rethrow);
    });

    cles::service me{io, {.name = "me", .peers = {{"camera", camera.endpoints().front()}}}};
    asio::co_spawn(io, watch(camera, me), rethrow);
    io.run();
}

// Prints:
// 25 % {"frames":1}
// 50 % {"frames":2}
// 75 % {"frames":3}
// 100 % {"frames":4}
// done: 4 frames
