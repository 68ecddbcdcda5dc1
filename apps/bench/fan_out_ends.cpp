// SPDX-License-Identifier: BSL-1.0
#include "fan_out_ends.hpp"

#include "figures.hpp"
#include "perf/baseline/publisher.hpp"
#include "perf/fan_out/fan_out_exchange.hpp"
#include "perf/support/clock.hpp"

#include <algorithm>

#include <unistd.h>

namespace tool {

namespace perf = cles::perf;

namespace {

double per_delivery(double total, const perf::fan_out_tally& tally) {
    return tally.delivered == 0 ? 0 : total / static_cast<double>(tally.delivered);
}

double lost_of(const perf::fan_out_order& order, const perf::fan_out_tally& tally) {
    return 1 - static_cast<double>(tally.delivered) / static_cast<double>(order.binders * order.updates);
}

/// Both passes, after a warm-up. `run` takes an order, and a recorder where latencies are wanted.
template <class Run>
fan_out_figures measure(pid_t publisher, const fan_out_orders& orders, perf::latency_recorder& record, Run&& run) {
    const auto cpu_of = [publisher](auto&& pass) {
        const auto before = perf::cpu_used(publisher) + perf::cpu_used(::getpid());
        pass();
        return microseconds(perf::cpu_used(publisher) + perf::cpu_used(::getpid()) - before);
    };
    const auto& [paced, flat_out] = orders;
    auto warm_up = flat_out;
    warm_up.updates = std::max<std::uint64_t>(1, flat_out.updates / 10);
    run(warm_up, nullptr);

    fan_out_figures figures;
    perf::fan_out_tally tally;
    const double paced_cpu = cpu_of([&] { tally = run(orders.paced, &record); });
    figures.paced = {.latency = to_figures(record.quantiles()),
                     .cpu_us = per_delivery(paced_cpu, tally),
                     .lost = lost_of(paced, tally)};

    const double cpu = cpu_of([&] { tally = run(orders.flat_out, nullptr); });
    const double seconds = microseconds(tally.took) / 1e6;
    figures.flat_out = {.deliveries_per_s = seconds == 0 ? 0 : static_cast<double>(tally.delivered) / seconds,
                        .cpu_us = per_delivery(cpu, tally),
                        .lost = lost_of(flat_out, tally)};
    return figures;
}

std::optional<perf::multicast_group> group_of(const bench_options& options, std::optional<perf::reserved_group>& port) {
    return options.transport == carrier::multicast ? std::optional{port.emplace().get()} : std::nullopt;
}

cles::multicast_options multicast_of(const bench_options& options, std::optional<perf::reserved_group>& port) {
    const auto group = group_of(options, port);
    return group ? cles::multicast_options{.interface = "lo", .group = group->address, .port = group->port}
                 : cles::multicast_options{};
}

cles::url by_hand_url(const bench_options& options) {
    const bool is_unix = options.transport == carrier::unix_socket;
    return cles::parse_url(bench_url(options.transport) + (is_unix ? "-by-hand" : ""));
}

} // namespace

fan_out_by_hand::fan_out_by_hand(const bench_options& options, int core)
    : group_(group_of(options, port_)), publisher_(core,
                                                   [&](const perf::child_process::announce& announce) {
                                                       perf::icd::publisher publisher{by_hand_url(options), group_};
                                                       announce(to_string(publisher.where()));
                                                       publisher.run();
                                                   }),
      binders_(cles::parse_url(publisher_.announced()), group_) {}

fan_out_figures fan_out_by_hand::run(const fan_out_orders& orders, perf::latency_recorder& record) {
    return measure(
        publisher_.id(), orders, record,
        [this](const perf::fan_out_order& order, perf::latency_recorder* into) { return binders_.run(order, into); });
}

fan_out_by_cles::fan_out_by_cles(const bench_options& options, int core)
    : options_(options), multicast_(multicast_of(options, port_)),
      publisher_(core, [&](const perf::child_process::announce& announce) {
          perf::serve_fan_out({.name = "car1", .listen = {bench_url(options.transport)}, .multicast = multicast_},
                              options.how, announce);
      }) {}

void fan_out_by_cles::connect(std::size_t binders) {
    if (!io_) {
        url_ = publisher_.announced();
        io_ = std::make_unique<boost::asio::io_context>(1);
    }
    clients_.clear();
    services_.clear();
    for (std::size_t i = 0; i < binders; ++i) { // feeds of one service would share a link
        cles::service_options client{
            .name = "bench" + std::to_string(i), .peers = {{"car1", url_}}, .multicast = multicast_};
        services_.push_back(std::make_unique<cles::service>(*io_, std::move(client)));
        clients_.push_back(services_.back().get());
    }
}

fan_out_figures fan_out_by_cles::run(const fan_out_orders& orders, perf::latency_recorder& record) {
    const perf::fan_out_binding binding{
        .style = options_.style, .how = options_.how, .keep = options_.keep, .multicast = multicast_.is_on()};
    return measure(publisher_.id(), orders, record,
                   [&](const perf::fan_out_order& order, perf::latency_recorder* into) {
                       return perf::take_fan_out(*io_, clients_, order, binding, into);
                   });
}

} // namespace tool
