// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "bench_medians.hpp"
#include "bench_progress.hpp"
#include "bench_run.hpp"
#include "perf/child_process.hpp"
#include "perf/cpu_clock.hpp"
#include "perf/fan_out_binders.hpp"
#include "perf/fan_out_publisher.hpp"
#include "perf/icd_binders.hpp"
#include "perf/icd_publisher.hpp"
#include "perf/latency_recorder.hpp"
#include "perf/pinning.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include <unistd.h>

namespace tool {

namespace perf = cles::perf;

namespace {

constexpr std::uint64_t rate_hz = 1000;
constexpr std::uint64_t paced_unless_told = 1000;
constexpr std::uint64_t deliveries_of_a_pass = 400'000;
constexpr std::uint64_t most_updates = 100'000;

/// One pass of an exchange: the order, and the recorder where latencies are wanted.
using exchange = std::function<perf::fan_out_tally(const perf::fan_out_order&, perf::latency_recorder*)>;

perf::fan_out_order paced_order(std::size_t binders, const bench_options& options) {
    return {.binders = binders,
            .updates = options.requests != 0 ? options.requests : paced_unless_told,
            .interval_ns = 1'000'000'000 / rate_hz};
}

perf::fan_out_order flat_out_order(std::size_t binders, const bench_options& options) {
    const auto suits = std::clamp<std::uint64_t>(deliveries_of_a_pass / binders, 1, most_updates);
    return {.binders = binders, .updates = options.requests != 0 ? options.requests : suits};
}

/// Processor time of both ends while something runs.
template <class Run>
double cpu_during(pid_t publisher, Run&& run) {
    const auto before = perf::cpu_used(publisher) + perf::cpu_used(::getpid());
    run();
    return microseconds(perf::cpu_used(publisher) + perf::cpu_used(::getpid()) - before);
}

double per_delivery(double total, const perf::fan_out_tally& tally) {
    return tally.delivered == 0 ? 0 : total / static_cast<double>(tally.delivered);
}

double lost_of(const perf::fan_out_order& order, const perf::fan_out_tally& tally) {
    return 1 - static_cast<double>(tally.delivered) / static_cast<double>(order.binders * order.updates);
}

/// Both kinds of pass, after a warm-up.
fan_out_figures measure(pid_t publisher, const exchange& run, const perf::fan_out_order& paced,
                        const perf::fan_out_order& flat_out, perf::latency_recorder& record) {
    perf::fan_out_order warm_up = flat_out;
    warm_up.updates = std::max<std::uint64_t>(1, flat_out.updates / 10);
    run(warm_up, nullptr);

    fan_out_figures figures;
    perf::fan_out_tally tally;
    const double paced_cpu = cpu_during(publisher, [&] { tally = run(paced, &record); });
    figures.paced = {.latency = to_figures(record.quantiles()),
                     .cpu_us = per_delivery(paced_cpu, tally),
                     .lost = lost_of(paced, tally)};

    const double cpu = cpu_during(publisher, [&] { tally = run(flat_out, nullptr); });
    const double seconds = microseconds(tally.took) / 1e6;
    figures.flat_out = {.deliveries_per_s = seconds == 0 ? 0 : static_cast<double>(tally.delivered) / seconds,
                        .cpu_us = per_delivery(cpu, tally),
                        .lost = lost_of(flat_out, tally)};
    return figures;
}

} // namespace

fan_out_report bench_fan_out(const bench_options& options) {
    const auto cores = places_of(options);
    const auto url = bench_url(options.transport);
    const auto by_hand_url = cles::parse_url(options.transport == carrier::unix_socket ? url + "-by-hand" : url);

    // The children come first: before there is anything of ours that they would inherit.
    perf::child_process by_hand{cores.server, [&](const perf::child_process::announce& announce) {
                                    perf::icd::publisher publisher{by_hand_url, std::nullopt};
                                    announce(to_string(publisher.where()));
                                    publisher.run();
                                }};
    perf::child_process publisher{cores.server, [&](const perf::child_process::announce& announce) {
                                      perf::serve_fan_out({.name = "car1", .listen = {url}}, options.how, announce);
                                  }};
    perf::icd::binders by_hand_binders{cles::parse_url(by_hand.announced()), std::nullopt};
    const auto cles_url = publisher.announced();
    perf::pin_to(cores.client);

    boost::asio::io_context io{1};
    cles::service client{io, {.name = "bench", .peers = {{"car1", cles_url}}}};
    const std::vector<cles::service*> clients{&client};
    const perf::fan_out_binding binding{.style = options.style, .how = options.how, .keep = options.keep};
    const exchange hand_written = [&](const perf::fan_out_order& order, perf::latency_recorder* record) {
        return by_hand_binders.run(order, record);
    };
    const exchange ours = [&](const perf::fan_out_order& order, perf::latency_recorder* record) {
        return perf::take_fan_out(io, clients, order, binding, record);
    };

    fan_out_report report{.transport = to_string(options.transport),
                          .style = to_string(options.style),
                          .rounds = options.rounds,
                          .rate_hz = rate_hz,
                          .busy_poll_us = options.how.busy_poll.count(),
                          .client_core = cores.client,
                          .server_core = cores.server};
    bench_progress progress{options.rounds * options.binders.size() * 2};
    for (const auto binders : options.binders) {
        const auto paced = paced_order(binders, options);
        const auto flat_out = flat_out_order(binders, options);
        perf::latency_recorder record{paced.updates * binders};
        std::vector<fan_out_figures> icd;
        std::vector<fan_out_figures> cles;
        const auto to = " to " + std::to_string(binders);
        for (std::size_t round = 0; round < options.rounds; ++round) {
            progress.step("hand-written" + to);
            icd.push_back(measure(by_hand.id(), hand_written, paced, flat_out, record));
            progress.step("CLES" + to);
            cles.push_back(measure(publisher.id(), ours, paced, flat_out, record));
        }
        fan_out_row row{.binders = binders, .paced_updates = paced.updates, .flat_out_updates = flat_out.updates};
        row.icd = median_of(icd);
        row.cles = median_of(cles);
        row.ratio = ratio_of(row.cles, row.icd);
        report.rows.push_back(row);
    }
    return report;
}

} // namespace tool
