// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "figures.hpp"
#include "measurements.hpp"
#include "perf/pull/bulk_load.hpp"
#include "perf/pull/pull_exchange.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/pinning.hpp"
#include "progress.hpp"
#include "report_table.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tool {

namespace perf = cles::perf;

namespace {

/// What small requests take beside large ones to the same node. All times are in microseconds.
struct urgent_report {
    std::string bench = "urgent";
    std::string transport{};
    std::string style{};
    std::size_t rounds = 0;
    std::uint64_t requests = 0; ///< small ones, in each pass
    std::int64_t busy_poll_us = 0;
    std::optional<std::int64_t> wake_within_us{}; ///< nothing: as the host has it
    std::size_t large_bytes = 0;
    std::size_t large_in_flight = 0;
    int client_core = 0;
    int server_core = 0;
    latency_figures idle{};
    latency_figures in_turn{}; ///< beside the large ones
    latency_figures urgent{};  ///< beside the large ones
};
BOOST_DESCRIBE_STRUCT(urgent_report, (),
                      (bench, transport, style, rounds, requests, busy_poll_us, wake_within_us, large_bytes,
                       large_in_flight, client_core, server_core, idle, in_turn, urgent))

std::string table_of(const urgent_report& report) {
    rows out{{"PULL localization", "p50 us", "p99 us", "p99.9 us", "max us"}};
    out.add("alone", report.idle);
    out.add("beside large replies", report.in_turn);
    out.add("beside large replies, urgent", report.urgent);
    out.add_ratio("urgent / alone", report.urgent, report.idle);
    return out.text() + "medians of " + std::to_string(report.rounds) + " rounds over " + report.transport + ", " +
           report.style + "s" + waiting(report.busy_poll_us, report.wake_within_us) + "; beside them " +
           std::to_string(report.large_in_flight) + " replies of " + std::to_string(report.large_bytes) +
           " bytes in flight; " + cores(report.client_core, report.server_core) + "\n";
}

constexpr std::uint64_t default_urgent_requests = 5'000;
constexpr std::size_t large_in_flight = 4; // so that the node always has the next to send

void serve(const bench_options& options, const perf::child_process::announce& announce) {
    boost::asio::io_context io{1};
    cles::service car{io, {.name = "car1", .listen = {bench_url(options.transport)}}};
    perf::register_localization(car);
    perf::register_bulk(car);
    announce(car.endpoints().front());
    run(io, options.how);
}

} // namespace

std::string measure_urgent(const bench_options& options) {
    const auto cores = places_of(options);
    perf::child_process server{cores.server,
                               [&](const perf::child_process::announce& announce) { serve(options, announce); }};
    perf::pin_to(cores.client);
    boost::asio::io_context io{1};
    cles::service client{io, {.name = "bench", .peers = {{"car1", server.announced()}}}};
    perf::pull_load small{io, client, "car1:localization", options.style, true, options.how};
    perf::bulk_load large{client, "car1"};

    const auto requests = options.requests != 0 ? options.requests : default_urgent_requests;
    perf::latency_recorder record{requests};
    bench_progress progress{options.rounds * 3};
    const auto pass = [&](const char* what, std::size_t beside, bool urgent, std::vector<latency_figures>& into) {
        progress.step(what);
        small.ask_urgently(urgent);
        small.run(options.in_flight, limit_of(options), record); // warms up, and makes the link
        large.start(beside);
        small.run(options.in_flight, limit_of(options), record);
        into.push_back(to_figures(record.quantiles()));
        large.stop();
        io.restart();
        while (large.in_flight() != 0) {
            io.run_one();
        }
    };
    std::vector<latency_figures> idle;
    std::vector<latency_figures> in_turn;
    std::vector<latency_figures> urgent;
    for (std::size_t round = 0; round < options.rounds; ++round) {
        pass("alone", 0, true, idle);
        pass("beside large replies", large_in_flight, false, in_turn);
        pass("beside large replies, urgent", large_in_flight, true, urgent);
    }
    const urgent_report report{.transport = to_string(options.transport),
                               .style = to_string(options.style),
                               .rounds = options.rounds,
                               .requests = requests,
                               .busy_poll_us = options.how.busy_poll.count(),
                               .wake_within_us = wake_within_us(options),
                               .large_bytes = perf::bulk_bytes,
                               .large_in_flight = large_in_flight,
                               .client_core = cores.client,
                               .server_core = cores.server,
                               .idle = median_of(idle),
                               .in_turn = median_of(in_turn),
                               .urgent = median_of(urgent)};
    return text_of(report, options);
}

} // namespace tool
