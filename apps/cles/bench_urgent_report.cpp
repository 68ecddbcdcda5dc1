// SPDX-License-Identifier: BSL-1.0
#include "bench_urgent_report.hpp"

#include "bench_medians.hpp"
#include "bench_table.hpp"

namespace tool {

std::string table_of(const urgent_report& report) {
    rows out{{"PULL localization", "p50 us", "p99 us", "p99.9 us", "max us"}};
    const auto add = [&](const char* name, const latency_figures& figures) {
        out.add({name, fixed(figures.p50_us, 1), fixed(figures.p99_us, 1), fixed(figures.p999_us, 1),
                 fixed(figures.max_us, 1)});
    };
    add("alone", report.idle);
    add("beside large answers", report.in_turn);
    add("beside large answers, urgent", report.urgent);
    const auto& alone = report.idle;
    const auto& urgent = report.urgent;
    out.add({"urgent / alone", times(over(urgent.p50_us, alone.p50_us)), times(over(urgent.p99_us, alone.p99_us)),
             times(over(urgent.p999_us, alone.p999_us)), times(over(urgent.max_us, alone.max_us))});
    return out.text() + "medians of " + std::to_string(report.rounds) + " rounds over " + report.transport + ", " +
           report.style + "s" + waiting(report.busy_poll_us, report.wake_within_us) + "; beside them " +
           std::to_string(report.large_in_flight) + " answers of " + std::to_string(report.large_bytes) +
           " bytes in flight; " + cores(report.client_core, report.server_core) + "\n";
}

} // namespace tool
