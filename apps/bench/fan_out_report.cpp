// SPDX-License-Identifier: BSL-1.0
#include "fan_out_report.hpp"

#include "figures.hpp"
#include "report_table.hpp"

#include <numeric>
#include <utility>

namespace tool {
namespace {

template <class Figures>
double mean_loss(const std::vector<Figures>& passes) {
    const double sum = std::accumulate(passes.begin(), passes.end(), 0.0,
                                       [](double before, const Figures& pass) { return before + pass.lost; });
    return sum / static_cast<double>(passes.size());
}

paced_figures median_of(const std::vector<paced_figures>& passes) {
    std::vector<latency_figures> latencies;
    latencies.reserve(passes.size());
    for (const auto& pass : passes) {
        latencies.push_back(pass.latency);
    }
    return {.latency = tool::median_of(latencies),
            .cpu_us = medians{passes}(&paced_figures::cpu_us),
            .lost = mean_loss(passes)};
}

flat_out_figures median_of(const std::vector<flat_out_figures>& passes) {
    const medians of{passes};
    return {.deliveries_per_s = of(&flat_out_figures::deliveries_per_s),
            .cpu_us = of(&flat_out_figures::cpu_us),
            .lost = mean_loss(passes)};
}

std::string percent(double share) { return share == 0 ? "0" : fixed(share * 100, 3) + "%"; }

void add(rows& out, const std::string& binders, const char* name, const fan_out_figures& figures) {
    const auto& [latency, paced_cpu, paced_lost] = figures.paced;
    const auto& [rate, cpu, lost] = figures.flat_out;
    out.add({name, binders, fixed(latency.p50_us, 1), fixed(latency.p99_us, 1), fixed(latency.p999_us, 1),
             fixed(latency.max_us, 1), fixed(paced_cpu, 2), percent(paced_lost), fixed(rate, 0), fixed(cpu, 2),
             percent(lost)});
}

} // namespace

fan_out_figures median_of(const std::vector<fan_out_figures>& passes) {
    std::vector<paced_figures> paced;
    std::vector<flat_out_figures> flat_out;
    for (const auto& pass : passes) {
        paced.push_back(pass.paced);
        flat_out.push_back(pass.flat_out);
    }
    return {.paced = median_of(paced), .flat_out = median_of(flat_out)};
}

fan_out_ratio ratio_of(const fan_out_figures& cles, const fan_out_figures& icd) {
    return {.p50 = over(cles.paced.latency.p50_us, icd.paced.latency.p50_us),
            .p99 = over(cles.paced.latency.p99_us, icd.paced.latency.p99_us),
            .p999 = over(cles.paced.latency.p999_us, icd.paced.latency.p999_us),
            .max = over(cles.paced.latency.max_us, icd.paced.latency.max_us),
            .paced_cpu = over(cles.paced.cpu_us, icd.paced.cpu_us),
            .deliveries_per_s = over(cles.flat_out.deliveries_per_s, icd.flat_out.deliveries_per_s),
            .flat_out_cpu = over(cles.flat_out.cpu_us, icd.flat_out.cpu_us)};
}

std::string table_of(const fan_out_report& report) {
    rows out{{"UPDATE localization", "subscribers", "p50 us", "p99 us", "p99.9 us", "max us", "CPU us", "lost",
              "max. rate/s", "CPU us (max.)", "lost (max.)"}};
    for (const auto& row : report.rows) {
        const auto binders = std::to_string(row.binders);
        const auto& ratio = row.ratio;
        add(out, binders, "hand-written", row.icd);
        add(out, binders, "CLES", row.cles);
        out.add({"ratio", binders, times(ratio.p50), times(ratio.p99), times(ratio.p999), times(ratio.max),
                 times(ratio.paced_cpu), "", times(ratio.deliveries_per_s), times(ratio.flat_out_cpu), ""});
    }
    return out.text() + "one way, at " + std::to_string(report.rate_hz) +
           " updates/s and as fast as possible; medians of " + std::to_string(report.rounds) + " rounds over " +
           report.transport + ", subscribers in one process, each with its own socket" +
           (report.transport == "multicast" ? " in the hand-written exchange, in CLES with one for all, " : ", ") +
           styles(report.style) + waiting(report.busy_poll_us, report.wake_within_us) + ", CPU per delivery; " +
           cores(report.client_core, report.server_core) + "\n";
}

} // namespace tool
