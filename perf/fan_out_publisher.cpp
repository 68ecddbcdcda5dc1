// SPDX-License-Identifier: BSL-1.0
#include "fan_out_publisher.hpp"

#include "fan_out.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <utility>

namespace cles::perf {

namespace asio = boost::asio;

namespace {

asio::awaitable<void> publish_paced(cles::service& car, fan_out_order order) {
    asio::steady_timer clock{car.get_executor(), asio::steady_timer::clock_type::now()};
    for (std::uint64_t i = 0; i < order.updates; ++i) {
        clock.expires_at(clock.expiry() + std::chrono::nanoseconds{order.interval_ns});
        co_await clock.async_wait(asio::use_awaitable);
        car.update("localization", publish_sample(i));
    }
}

asio::awaitable<void> publish_flat_out(cles::service& car, std::uint64_t updates) {
    for (std::uint64_t i = 0; i < updates; ++i) {
        co_await car.async_update("localization", publish_sample(i));
    }
}

} // namespace

void serve_fan_out(service_options options, const run_options& how, const child_process::announce& announce) {
    asio::io_context io{1};
    cles::service car{io, std::move(options)};
    car.on_bind("localization");
    car.on_push("publish", [&car](fan_out_order order) {
        return order.interval_ns != 0 ? publish_paced(car, order) : publish_flat_out(car, order.updates);
    });
    announce(car.endpoints().front());
    run(io, how);
}

} // namespace cles::perf
