// SPDX-License-Identifier: BSL-1.0
#include "fan_out_ends.hpp"
#include "measurements.hpp"
#include "progress.hpp"

#include <algorithm>

namespace tool {

namespace perf = cles::perf;

namespace {

constexpr std::uint64_t rate_hz = 1000;
constexpr std::uint64_t default_paced_updates = 1000;
constexpr std::uint64_t default_flat_out_deliveries = 200'000;
constexpr std::uint64_t max_flat_out_updates = 40'000;

fan_out_orders orders_of(std::size_t binders, const bench_options& options) {
    const auto told = options.requests;
    const auto suits = std::clamp<std::uint64_t>(default_flat_out_deliveries / binders, 1, max_flat_out_updates);
    return {.paced = {.binders = binders,
                      .updates = told != 0 ? told : default_paced_updates,
                      .interval_ns = 1'000'000'000 / rate_hz},
            .flat_out = {.binders = binders, .updates = told != 0 ? told : suits}};
}

} // namespace

std::string measure_fan_out(const bench_options& options) {
    const auto cores = places_of(options);
    fan_out_by_hand by_hand{options, cores.server};
    fan_out_by_cles by_cles{options, cores.server};
    perf::pin_to(cores.client);

    fan_out_report report{.transport = to_string(options.transport),
                          .style = to_string(options.style),
                          .rounds = options.rounds,
                          .rate_hz = rate_hz,
                          .busy_poll_us = options.how.busy_poll.count(),
                          .wake_within_us = wake_within_us(options),
                          .client_core = cores.client,
                          .server_core = cores.server};
    bench_progress progress{options.rounds * options.binders.size() * 2};
    for (const auto binders : options.binders) {
        const auto orders = orders_of(binders, options);
        perf::latency_recorder record{orders.paced.updates * binders};
        std::vector<fan_out_figures> icd;
        std::vector<fan_out_figures> cles;
        by_cles.connect(binders);
        for (std::size_t round = 0; round < options.rounds; ++round) {
            progress.step("hand-written to " + std::to_string(binders));
            icd.push_back(by_hand.run(orders, record));
            progress.step("CLES to " + std::to_string(binders));
            cles.push_back(by_cles.run(orders, record));
        }
        fan_out_row row{.binders = binders,
                        .paced_updates = orders.paced.updates,
                        .flat_out_updates = orders.flat_out.updates,
                        .icd = median_of(icd),
                        .cles = median_of(cles)};
        row.ratio = ratio_of(row.cles, row.icd);
        report.rows.push_back(row);
    }
    return text_of(report, options);
}

} // namespace tool
