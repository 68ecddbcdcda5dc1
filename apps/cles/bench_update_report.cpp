// SPDX-License-Identifier: BSL-1.0
#include "bench_update_report.hpp"

#include "bench_medians.hpp"
#include "bench_table.hpp"

#include <utility>

namespace tool {
namespace {

std::vector<std::string> cells_of(std::string name, const update_figures& figures) {
    return {std::move(name),
            fixed(figures.deliveries_per_s, 0),
            fixed(figures.updates_per_s, 0),
            fixed(figures.cpu_binder_us, 3),
            fixed(figures.cpu_publisher_us, 3),
            std::to_string(figures.missed)};
}

} // namespace

update_figures median_of(const std::vector<update_figures>& passes) {
    using figures = update_figures;
    const medians of{passes};
    update_figures result{.deliveries_per_s = of(&figures::deliveries_per_s),
                          .updates_per_s = of(&figures::updates_per_s),
                          .cpu_us = of(&figures::cpu_us),
                          .cpu_binder_us = of(&figures::cpu_binder_us),
                          .cpu_publisher_us = of(&figures::cpu_publisher_us)};
    for (const auto& pass : passes) {
        result.missed += pass.missed;
    }
    return result;
}

std::string table_of(const update_report& report) {
    rows out{{"UPDATE localization", "deliveries/s", "updates/s", "binder CPU us", "publisher CPU us", "missed"}};
    out.add(cells_of("raw (json_text)", report.raw));
    out.add(cells_of("typed (struct)", report.typed));
    return out.text() + "medians of " + std::to_string(report.rounds) + " rounds of " + std::to_string(report.updates) +
           " updates over " + report.transport + " to " + std::to_string(report.binders) + " binder" +
           (report.binders == 1 ? "" : "s") + ", " + report.style + "s" +
           waiting(report.busy_poll_us, report.wake_within_us) + ", " + fixed(report.update_bytes, 1) +
           " bytes per update, CPU per delivery; " + cores(report.client_core, report.server_core) + "\n";
}

} // namespace tool
