// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "figures.hpp"
#include "measurements.hpp"
#include "output/errors.hpp"
#include "perf/pull/core_load.hpp"
#include "perf/pull/pull_exchange.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/pinning.hpp"
#include "progress.hpp"
#include "report_table.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/describe/class.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

namespace tool {

namespace perf = cles::perf;

namespace {

/// How steady PULL is while other processes use the cores. All times are in microseconds.
struct stress_report {
    std::string bench = "stress";
    std::string transport{};
    std::string style{};
    std::size_t rounds = 0;
    std::uint64_t requests = 0; ///< in each pass
    std::int64_t busy_poll_us = 0;
    std::optional<std::int64_t> wake_within_us{}; ///< nothing: as the host has it
    std::size_t processes = 0;                    ///< that use the cores too
    int client_core = 0;
    int server_core = 0;
    latency_figures idle{};
    std::optional<latency_figures> idle_fifo{}; ///< nothing if the system does not permit it
    latency_figures loaded{};
    std::optional<latency_figures> loaded_fifo{};
};
BOOST_DESCRIBE_STRUCT(stress_report, (),
                      (bench, transport, style, rounds, requests, busy_poll_us, wake_within_us, processes, client_core,
                       server_core, idle, idle_fifo, loaded, loaded_fifo))

std::string table_of(const stress_report& report) {
    rows out{{"PULL localization", "p50 us", "p99 us", "p99.9 us", "max us"}};
    out.add("idle cores", report.idle);
    if (report.idle_fifo) {
        out.add("idle cores, SCHED_FIFO", *report.idle_fifo);
    }
    out.add("loaded cores", report.loaded);
    if (report.idle_fifo && report.loaded_fifo) {
        out.add("loaded cores, SCHED_FIFO", *report.loaded_fifo);
        out.add_ratio("loaded / idle, SCHED_FIFO", *report.loaded_fifo, *report.idle_fifo);
    }
    return out.text() + "medians of " + std::to_string(report.rounds) + " rounds over " + report.transport + ", " +
           report.style + "s" + waiting(report.busy_poll_us, report.wake_within_us) +
           "; load: " + std::to_string(report.processes) + " processes that never sleep; " +
           cores(report.client_core, report.server_core) + "\n";
}

constexpr std::uint64_t default_stressed_requests = 20'000;
constexpr int busy_processes_per_core = 2;
constexpr int priority = 50; // above normal processes, below what the kernel itself needs

/// A node, its client, and how both are scheduled.
class pair_of_ends {
  public:
    pair_of_ends(const perf::placement& cores, const bench_options& options, const cles::run_options& how)
        : options_(options), how_(how), server_(cores.server, [&](const perf::child_process::announce& announce) {
              perf::serve_localization(bench_url(options.transport), how, announce);
          }) {}

    /// After all processes have been forked.
    void connect(boost::asio::io_context& io) {
        client_ = std::make_unique<cles::service>(
            io, cles::service_options{.name = "bench", .peers = {{"car1", server_.announced()}}});
        load_ = std::make_unique<perf::pull_load>(io, *client_, "car1:localization", options_.style, true, how_);
    }

    latency_figures pass(perf::latency_recorder& record) {
        load_->run(options_.in_flight, limit_of(options_), record);
        return to_figures(record.quantiles());
    }

  private:
    const bench_options& options_;
    cles::run_options how_;
    perf::child_process server_;
    std::unique_ptr<cles::service> client_;
    std::unique_ptr<perf::pull_load> load_;
};

bool may_be_real_time(const cles::run_options& how) {
    try {
        boost::asio::io_context nothing_to_do;
        cles::run(nothing_to_do, how);
        return true;
    } catch (const std::system_error& refused) {
        note(std::string{"without real-time scheduling: "} + refused.what());
        return false;
    }
}

} // namespace

std::string measure_stress(const bench_options& options) {
    const auto all_cores = perf::usable_cores(); // before this thread is pinned to one
    const auto cores = places_of(options);
    auto urgent = options.how;
    urgent.fifo_priority = priority;

    // Before this process has anything that the children would inherit.
    pair_of_ends normal{cores, options, options.how};
    std::unique_ptr<pair_of_ends> real_time;
    if (may_be_real_time(urgent)) {
        urgent.lock_memory = true;
        real_time = std::make_unique<pair_of_ends>(cores, options, urgent);
    }
    perf::pin_to(cores.client);
    boost::asio::io_context io{1};
    normal.connect(io);
    if (real_time) {
        real_time->connect(io);
    }

    const auto requests = options.requests != 0 ? options.requests : default_stressed_requests;
    perf::latency_recorder record{requests};
    std::vector<latency_figures> idle;
    std::vector<latency_figures> idle_fifo;
    std::vector<latency_figures> loaded;
    std::vector<latency_figures> loaded_fifo;
    bench_progress progress{options.rounds * 2};
    const auto measure = [&](auto& normally, auto& first) {
        normal.pass(record); // warms up
        normally.push_back(normal.pass(record));
        if (real_time) {
            real_time->pass(record);
            first.push_back(real_time->pass(record));
        }
    };
    for (std::size_t round = 0; round < options.rounds; ++round) {
        progress.step("on idle cores");
        measure(idle, idle_fifo);
        progress.step("on loaded cores");
        const perf::core_load others{all_cores, busy_processes_per_core};
        measure(loaded, loaded_fifo);
    }

    stress_report report{.transport = to_string(options.transport),
                         .style = to_string(options.style),
                         .rounds = options.rounds,
                         .requests = requests,
                         .busy_poll_us = options.how.busy_poll.count(),
                         .wake_within_us = wake_within_us(options),
                         .processes = busy_processes_per_core * all_cores.size(),
                         .client_core = cores.client,
                         .server_core = cores.server,
                         .idle = median_of(idle),
                         .loaded = median_of(loaded)};
    if (real_time) {
        report.idle_fifo = median_of(idle_fifo);
        report.loaded_fifo = median_of(loaded_fifo);
    }
    return text_of(report, options);
}

} // namespace tool
