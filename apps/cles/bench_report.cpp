// SPDX-License-Identifier: BSL-1.0
#include "bench_report.hpp"

#include "table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace tool {
double rounded(double value) { return std::round(value * 1e3) / 1e3; }

namespace {

template <class Figures>
class medians {
  public:
    explicit medians(const std::vector<Figures>& passes) : passes_(passes) {}

    double operator()(double Figures::*figure) const {
        std::vector<double> values;
        for (const auto& pass : passes_) {
            values.push_back(pass.*figure);
        }
        return median(std::move(values));
    }
    std::optional<double> operator()(std::optional<double> Figures::*figure) const {
        std::vector<double> values;
        for (const auto& pass : passes_) {
            if (pass.*figure) {
                values.push_back(*(pass.*figure));
            }
        }
        return values.empty() ? std::nullopt : std::optional{median(std::move(values))};
    }

  private:
    static double median(std::vector<double> values) {
        std::sort(values.begin(), values.end());
        const auto middle = values.size() / 2;
        return rounded(values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2);
    }

    const std::vector<Figures>& passes_;
};

double over(double a, double b) { return b == 0 ? 0 : rounded(a / b); }

std::optional<double> over(std::optional<double> a, std::optional<double> b) {
    return a && b ? std::optional{over(*a, *b)} : std::nullopt;
}

std::optional<double> bytes_of(const exchange_figures& figures) {
    if (!figures.request_bytes || !figures.reply_bytes) {
        return std::nullopt;
    }
    return *figures.request_bytes + *figures.reply_bytes;
}

std::string fixed(double value, int digits) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "%.*f", digits, value);
    return text.data();
}

std::string fixed(std::optional<double> value, int digits) { return value ? fixed(*value, digits) : "-"; }

std::string times(double ratio) { return fixed(ratio, 2) + "x"; }
std::string times(std::optional<double> ratio) { return ratio ? times(*ratio) : "-"; }

class rows {
  public:
    explicit rows(const std::vector<std::string>& titles) {
        for (const auto& title : titles) {
            table_.column(title);
        }
    }
    void add(const std::vector<std::string>& cells) {
        table_.row();
        for (std::size_t i = 0; i < cells.size(); ++i) {
            table_.set(i, cells[i], i != 0);
        }
    }
    [[nodiscard]] std::string text() const { return table_.text(); }

  private:
    table table_;
};

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

std::vector<std::string> cells_of(std::string name, const update_figures& figures) {
    return {std::move(name),
            fixed(figures.deliveries_per_s, 0),
            fixed(figures.updates_per_s, 0),
            fixed(figures.cpu_binder_us, 3),
            fixed(figures.cpu_publisher_us, 3),
            std::to_string(figures.missed)};
}

std::string cores(int client, std::optional<int> server) {
    if (!server) {
        return "client on core " + std::to_string(client);
    }
    if (*server == client) {
        return "both ends on core " + std::to_string(client) + ": they wait for each other's turn";
    }
    return "client on core " + std::to_string(client) + ", server on core " + std::to_string(*server);
}

std::string polling(std::int64_t busy_poll_us) {
    return busy_poll_us == 0 ? std::string{} : ", CLES polling up to " + std::to_string(busy_poll_us) + " us";
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

latency_figures median_of(const std::vector<latency_figures>& passes) {
    using figures = latency_figures;
    const medians of{passes};
    return {.p50_us = of(&figures::p50_us),
            .p99_us = of(&figures::p99_us),
            .p999_us = of(&figures::p999_us),
            .max_us = of(&figures::max_us)};
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
    out.add(cells_of("CLES (" + report.transport + ")", report.cles));
    if (report.ratio) {
        const auto& ratio = *report.ratio;
        out.add({"ratio", times(ratio.p50), times(ratio.p99), times(ratio.p999), times(ratio.max),
                 times(ratio.requests_per_s), times(ratio.cpu), times(ratio.bytes)});
    }
    return out.text() + "medians of " + std::to_string(report.rounds) + " rounds, " + std::to_string(report.in_flight) +
           " in flight, " + report.style + "s" + polling(report.busy_poll_us) + "; " + where(report) +
           (report.against ? "; against " + *report.against : std::string{}) + "\n";
}

std::string table_of(const update_report& report) {
    rows out{{"UPDATE localization", "deliveries/s", "updates/s", "binder CPU us", "publisher CPU us", "missed"}};
    out.add(cells_of("raw (json_text)", report.raw));
    out.add(cells_of("typed (struct)", report.typed));
    return out.text() + "medians of " + std::to_string(report.rounds) + " rounds of " + std::to_string(report.updates) +
           " updates over " + report.transport + " to " + std::to_string(report.binders) + " binder" +
           (report.binders == 1 ? "" : "s") + ", " + report.style + "s" + polling(report.busy_poll_us) + ", " +
           fixed(report.update_bytes, 1) + " bytes per update, CPU per delivery; " +
           cores(report.client_core, report.server_core) + "\n";
}

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
           report.style + "s" + polling(report.busy_poll_us) + "; load: " + std::to_string(report.processes) +
           " processes that never sleep; " + cores(report.client_core, report.server_core) + "\n";
}

} // namespace tool
