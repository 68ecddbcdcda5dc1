// SPDX-License-Identifier: BSL-1.0
#include "bench_stress_report.hpp"

#include "bench_medians.hpp"
#include "bench_table.hpp"

namespace tool {

std::string table_of(const stress_report& report) {
    rows out{{"PULL localization", "p50 us", "p99 us", "p99.9 us", "max us"}};
    const auto add = [&](const char* name, const latency_figures& figures) {
        out.add({name, fixed(figures.p50_us, 1), fixed(figures.p99_us, 1), fixed(figures.p999_us, 1),
                 fixed(figures.max_us, 1)});
    };
    add("idle cores", report.idle);
    if (report.idle_fifo) {
        add("idle cores, SCHED_FIFO", *report.idle_fifo);
    }
    add("loaded cores", report.loaded);
    if (report.idle_fifo && report.loaded_fifo) {
        add("loaded cores, SCHED_FIFO", *report.loaded_fifo);
        const auto& idle = *report.idle_fifo;
        const auto& loaded = *report.loaded_fifo;
        out.add({"loaded / idle, SCHED_FIFO", times(over(loaded.p50_us, idle.p50_us)),
                 times(over(loaded.p99_us, idle.p99_us)), times(over(loaded.p999_us, idle.p999_us)),
                 times(over(loaded.max_us, idle.max_us))});
    }
    return out.text() + "medians of " + std::to_string(report.rounds) + " rounds over " + report.transport + ", " +
           report.style + "s" + waiting(report.busy_poll_us, report.wake_within_us) +
           "; load: " + std::to_string(report.processes) + " processes that never sleep; " +
           cores(report.client_core, report.server_core) + "\n";
}

} // namespace tool
