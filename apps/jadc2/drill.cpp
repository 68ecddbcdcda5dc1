// SPDX-License-Identifier: BSL-1.0
#include "drill.hpp"

#include <cles/service.hpp>

#include "client/member_key.hpp"
#include "events.hpp"
#include "geo/traffic.hpp"
#include "strike/order.hpp"

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

namespace jadc2 {
namespace {

using steady = std::chrono::steady_clock;

struct quantiles {
    std::uint64_t count = 0;
    double p50_us = 0, p90_us = 0, p99_us = 0, max_us = 0;
};
BOOST_DESCRIBE_STRUCT(quantiles, (), (count, p50_us, p90_us, p99_us, max_us))

constexpr std::uint64_t deadline_ms = 5000;
constexpr std::uint64_t warm_up = 20; ///< orders: the first one opens the link

struct named_node {
    std::string node{};
};
BOOST_DESCRIBE_STRUCT(named_node, (), (node))

// A request is signed only for a node that is named.
boost::asio::awaitable<std::string> target_of(cles::service& from, const drill_options& args) {
    if (args.keys.empty()) {
        co_return "self";
    }
    const auto options = cles::call_options{}.at(args.at);
    const auto there = co_await from.async_pull<named_node>("self:cles", options);
    co_return there.node;
}

boost::asio::awaitable<void> give_orders(cles::service& from, const drill_options& args, std::vector<double>& took) {
    boost::asio::steady_timer pause{from.get_executor()};
    const auto options = cles::call_options{}.deadline(std::chrono::milliseconds{deadline_ms}).urgent().at(args.at);
    const auto noun = co_await target_of(from, args) + ":strike";
    const auto run = "drill-" + run_id() + "-";
    auto next = steady::now();
    for (std::uint64_t i = 0; i < args.count + warm_up; ++i) {
        const double now = utc_now();
        const strike::order what{.id = run + std::to_string(i),
                                 .lat = geo::traffic::origin.lat,
                                 .lon = geo::traffic::origin.lon,
                                 .ve = 12,
                                 .vn = -6,
                                 .sigma = 3,
                                 .sigma_v = 1,
                                 .utc = now,
                                 .until = now + static_cast<double>(deadline_ms) / 1000,
                                 .drill = true};
        const auto begun = steady::now();
        const auto outcome = co_await from.async_delegate<strike::outcome>(noun, what, options);
        if (i >= warm_up && outcome.order == what.id) {
            took.push_back(std::chrono::duration<double, std::micro>(steady::now() - begun).count());
        }
        next = std::max(next, steady::now()) + std::chrono::microseconds{args.every_us};
        pause.expires_at(next);
        co_await pause.async_wait(boost::asio::use_awaitable);
    }
}

} // namespace

int drill(const drill_options& args) {
    boost::asio::io_context io{1};
    cles::service node{io, tool::options_of_member("drill", args.keys)};
    std::vector<double> took;
    std::exception_ptr failure;
    boost::asio::co_spawn(io, give_orders(node, args, took), [&](const std::exception_ptr& thrown) {
        failure = thrown;
        node.stop();
    });
    io.run();
    if (failure) {
        std::rethrow_exception(failure);
    }
    std::sort(took.begin(), took.end());
    const auto at = [&took](double part) {
        return took[std::min(took.size() - 1, static_cast<std::size_t>(part * static_cast<double>(took.size())))];
    };
    std::puts(cles::to_json(quantiles{took.size(), at(0.5), at(0.9), at(0.99), took.back()}).c_str());
    return 0;
}

} // namespace jadc2
