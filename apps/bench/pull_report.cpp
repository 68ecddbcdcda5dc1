// SPDX-License-Identifier: BSL-1.0
#include "pull_report.hpp"

#include "figures.hpp"
#include "report_table.hpp"

#include <utility>

namespace tool {
namespace {

std::optional<double> bytes_of(const exchange_figures& figures) {
    if (!figures.request_bytes || !figures.reply_bytes) {
        return std::nullopt;
    }
    return *figures.request_bytes + *figures.reply_bytes;
}

std::vector<std::string> cells_of(std::string name, const exchange_figures& figures) {
    return {std::move(name),
            fixed(figures.p50_us, 1),
            fixed(figures.p99_us, 1),
            fixed(figures.p999_us, 1),
            fixed(figures.max_us, 1),
            fixed(figures.requests_per_s, 0),
            fixed(figures.cpu_us ? *figures.cpu_us : figures.cpu_client_us, 2) + (figures.cpu_us ? "" : " (client)"),
            fixed(bytes_of(figures), 1)};
}

std::string where(const pull_report& report) {
    return report.transport == "inproc" ? "both ends in one process, on core " + std::to_string(report.client_core)
                                        : cores(report.client_core, report.server_core);
}

} // namespace

exchange_figures median_of(const std::vector<exchange_figures>& passes) {
    using figures = exchange_figures;
    const medians of{passes};
    return {.p50_us = of(&figures::p50_us),
            .p99_us = of(&figures::p99_us),
            .p999_us = of(&figures::p999_us),
            .max_us = of(&figures::max_us),
            .requests_per_s = of(&figures::requests_per_s),
            .cpu_us = of(&figures::cpu_us),
            .cpu_client_us = of(&figures::cpu_client_us),
            .cpu_server_us = of(&figures::cpu_server_us),
            .request_bytes = of(&figures::request_bytes),
            .reply_bytes = of(&figures::reply_bytes)};
}

exchange_ratio ratio_of(const exchange_figures& cles, const exchange_figures& icd) {
    return {.p50 = over(cles.p50_us, icd.p50_us),
            .p99 = over(cles.p99_us, icd.p99_us),
            .p999 = over(cles.p999_us, icd.p999_us),
            .max = over(cles.max_us, icd.max_us),
            .requests_per_s = over(cles.requests_per_s, icd.requests_per_s),
            .cpu = over(cles.cpu_us, icd.cpu_us),
            .bytes = over(bytes_of(cles), bytes_of(icd))};
}

std::string table_of(const pull_report& report) {
    rows out{{"PULL localization", "p50 us", "p99 us", "p99.9 us", "max us", "requests/s", "CPU us/request", "bytes"}};
    if (report.icd) {
        out.add(cells_of("hand-written (tcp)", *report.icd));
    }
    if (report.icd_unix) {
        out.add(cells_of("hand-written (unix)", *report.icd_unix));
    }
    if (report.icd_udp) {
        out.add(cells_of("hand-written (udp)", *report.icd_udp));
    }
    out.add(cells_of("CLES (" + report.transport + ")", report.cles));
    if (report.ratio) {
        const auto& ratio = *report.ratio;
        out.add({"ratio", times(ratio.p50), times(ratio.p99), times(ratio.p999), times(ratio.max),
                 times(ratio.requests_per_s), times(ratio.cpu), times(ratio.bytes)});
    }
    return out.text() + "medians of " + std::to_string(report.rounds) + " rounds, " + std::to_string(report.in_flight) +
           " in flight, " + report.style + "s" + waiting(report.busy_poll_us, report.wake_within_us) + "; " +
           where(report) + (report.against ? "; against " + *report.against : std::string{}) + "\n";
}

} // namespace tool
