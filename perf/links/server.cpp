// SPDX-License-Identifier: BSL-1.0
#include <cles/multicast.hpp>
#include <cles/service.hpp>

#include "ends.hpp"
#include "perf/baseline/exchange.hpp"
#include "perf/baseline/packet.hpp"
#include "perf/pull/pull_exchange.hpp"
#include "perf/support/bare_socket.hpp"
#include "timed_sample.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <exception>
#include <string>
#include <system_error>
#include <thread>

namespace cles::perf {

namespace asio = boost::asio;

namespace {

asio::awaitable<void> publish(cles::service& car, std::chrono::milliseconds interval) {
    asio::steady_timer clock{car.get_executor(), asio::steady_timer::clock_type::now()};
    for (std::uint64_t i = 0;; ++i) {
        clock.expires_at(clock.expiry() + interval);
        co_await clock.async_wait(asio::use_awaitable);
        car.update("localization", timed_sample(i));
    }
}

void rethrow(const std::exception_ptr& failure) {
    if (failure) {
        std::rethrow_exception(failure);
    }
}

void send_updates(int client, std::chrono::milliseconds interval) {
    auto next = std::chrono::steady_clock::now();
    for (std::uint64_t i = 0;; ++i) {
        next += interval;
        std::this_thread::sleep_until(next);
        send_all(client, icd::pack_reply(timed_sample(i)));
    }
}

} // namespace

void serve_replies(std::string_view url, const announcement& announce) {
    asio::io_context io{1};
    cles::service car{io, {.name = "car1", .listen = {std::string{url}}, .insecure = true}};
    register_localization(car);
    announce(car.endpoints().front());
    io.run();
}

void serve_replies_by_hand(std::string_view url, const announcement& announce) {
    icd::server server{parse_url(url)};
    announce(to_string(server.where()));
    server.run();
}

void serve_updates(std::string_view url, std::string_view group, std::chrono::milliseconds interval,
                   const announcement& announce) {
    asio::io_context io{1};
    cles::service car{
        io, {.name = "car1", .listen = {std::string{url}}, .insecure = true, .multicast = parse_multicast(group)}};
    car.on_bind("localization"); // from the beginning, before anything is published
    asio::co_spawn(io, publish(car, interval), rethrow);
    announce(car.endpoints().front());
    io.run();
}

void serve_updates_by_hand(std::string_view url, std::chrono::milliseconds interval, const announcement& announce) {
    const auto at = listen_on(parse_url(url));
    announce(to_string(at.where));
    for (;;) {
        const auto client = accept_from(at);
        try {
            send_updates(client.get(), interval);
        } catch (const std::system_error&) {
            continue; // the client has disconnected
        }
    }
}

} // namespace cles::perf
