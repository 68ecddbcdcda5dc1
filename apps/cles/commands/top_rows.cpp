// SPDX-License-Identifier: BSL-1.0
#include "commands/top_rows.hpp"

#include <cles/json_writer.hpp>

#include "options/duration.hpp"
#include "output/statistics.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"

#include <algorithm>
#include <chrono>
#include <optional>
#include <string_view>
#include <tuple>

namespace tool {
namespace {

double work_per_worker(const top_row& row) {
    if (!row.node.load) {
        return 0;
    }
    const auto& load = *row.node.load;
    return (static_cast<double>(load.running) + load.queued) / std::max(1U, load.workers);
}

std::string or_dash(const std::optional<double>& value, int digits) { return value ? fixed(*value, digits) : "-"; }

// With the unit that keeps it short: "6.1 us", "3.22 s".
std::string span_or_dash(const std::optional<double>& us) {
    if (!us) {
        return "-";
    }
    if (*us < 999.95) {
        return fixed(*us, 1) + " us";
    }
    return *us < 999'995 ? fixed(*us / 1e3, 2) + " ms" : fixed(*us / 1e6, 2) + " s";
}

void add(cles::json_writer& w, std::string_view name, const std::optional<double>& value) {
    if (value) {
        w.key(name);
        w.value(rounded(*value, 3));
    }
}

} // namespace

void sort_rows(std::vector<top_row>& rows, top_order order) {
    const auto rank = [&](const top_row& row) {
        const auto first = order == top_order::load ? -work_per_worker(row) : 0.0;
        const auto second = order == top_order::load ? -row.rate.requests.value_or(0) : 0.0;
        return std::tuple{first, second, std::string_view{row.node.node}};
    };
    std::stable_sort(rows.begin(), rows.end(), [&](const top_row& a, const top_row& b) { return rank(a) < rank(b); });
}

std::string summary_of(const std::vector<top_row>& rows) {
    std::uint64_t queued = 0;
    std::uint64_t running = 0;
    double requests = 0;
    for (const auto& row : rows) {
        if (row.node.load) {
            queued += row.node.load->queued;
            running += row.node.load->running;
        }
        requests += row.rate.requests.value_or(0);
    }
    return std::to_string(rows.size()) + (rows.size() == 1 ? " node, " : " nodes, ") + fixed(requests, 0) +
           " requests/s, " + std::to_string(running) + " running, " + std::to_string(queued) + " queued";
}

std::string to_table(const std::vector<top_row>& rows) {
    table out;
    for (const char* title :
         {"NODE", "STATE", "WORKERS", "RUNNING", "QUEUED", "REQ/S", "ERR/S", "P50", "P99", "HEARD"}) {
        out.column(title);
    }
    const auto number = [&](std::size_t column, std::string text) { out.set(column, std::move(text), true); };
    for (const auto& row : rows) {
        const auto& node = row.node;
        out.row();
        out.set(0, printable(node.node));
        out.set(1, printable(node.state));
        number(2, node.load && node.load->workers != 0 ? std::to_string(node.load->workers) : "-");
        number(3, node.load ? std::to_string(node.load->running) : "-");
        number(4, node.load ? std::to_string(node.load->queued) : "-");
        number(5, or_dash(row.rate.requests, 0));
        number(6, or_dash(row.rate.errors, 0));
        number(7, span_or_dash(row.rate.p50_us));
        number(8, span_or_dash(row.rate.p99_us));
        auto heard = node.age_ms ? to_text(std::chrono::milliseconds{*node.age_ms}) + " ago" : std::string{"now"};
        out.set(9, node.error.empty() ? std::move(heard) : heard + " (" + printable(node.error) + ")");
    }
    return out.text();
}

std::string to_json(const std::vector<top_row>& rows) {
    std::string out;
    cles::json_writer w{out};
    w.begin_object();
    w.key("nodes");
    w.begin_array();
    for (const auto& row : rows) {
        w.begin_object();
        w.key("node");
        w.value(std::string_view{row.node.node});
        w.key("state");
        w.value(std::string_view{row.node.state});
        if (row.node.load) {
            w.key("load");
            write_load(w, *row.node.load);
        }
        add(w, "requests_per_s", row.rate.requests);
        add(w, "errors_per_s", row.rate.errors);
        add(w, "handler_p50_us", row.rate.p50_us);
        add(w, "handler_p99_us", row.rate.p99_us);
        w.key("age_ms");
        w.value(row.node.age_ms.value_or(0));
        if (!row.node.error.empty()) {
            w.key("failure");
            w.value(std::string_view{row.node.error});
        }
        w.end_object();
    }
    w.end_array();
    w.end_object();
    return out;
}

} // namespace tool
