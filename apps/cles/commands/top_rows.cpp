// SPDX-License-Identifier: BSL-1.0
#include "commands/top_rows.hpp"

#include <cles/json_writer.hpp>

#include "output/statistics.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <optional>
#include <string_view>
#include <system_error>
#include <tuple>
#include <utility>

namespace tool {
namespace {

template <class T>
std::optional<T> number_in(const json_node* node) {
    T value{};
    if (node == nullptr || node->kind != json_node::type::other) {
        return {};
    }
    const auto* end = node->text.data() + node->text.size();
    const auto [rest, code] = std::from_chars(node->text.data(), end, value);
    return code == std::errc{} && rest == end ? std::optional{value} : std::nullopt;
}

double per_second(std::uint64_t before, std::uint64_t after, double seconds) {
    return after <= before ? 0 : static_cast<double>(after - before) / seconds;
}

double jobs_per_worker(const top_row& row) {
    if (!row.node.load) {
        return 0;
    }
    const auto& load = *row.node.load;
    return (static_cast<double>(load.running) + load.queued) / std::max(1U, load.workers);
}

std::string number_text(const std::optional<double>& value, int digits) { return value ? fixed(*value, digits) : "-"; }

// In the unit that keeps it short: "6.1 us", "3.22 s".
std::string time_text(const std::optional<double>& us) {
    if (!us) {
        return "-";
    }
    if (*us < 999.95) {
        return fixed(*us, 1) + " us";
    }
    return *us < 999'995 ? fixed(*us / 1e3, 2) + " ms" : fixed(*us / 1e6, 2) + " s";
}

void write_count(cles::json_writer& w, std::string_view name, const std::optional<std::uint64_t>& value) {
    if (value) {
        w.key(name);
        w.value(*value);
    }
}

void write_rate(cles::json_writer& w, std::string_view name, const std::optional<double>& value) {
    if (value) {
        w.key(name);
        w.value(rounded(*value, 3));
    }
}

void write_tasks(cles::json_writer& w, const std::vector<task_time>& tasks) {
    w.key("tasks");
    w.begin_array();
    for (const auto& each : tasks) {
        w.begin_object();
        w.key("task");
        w.value(std::string_view{each.task});
        w.key("verb");
        w.value(std::string_view{each.verb});
        w.key("samples");
        w.value(each.samples);
        w.key("p50_us");
        w.value(rounded(each.p50_us, 3));
        w.key("p99_us");
        w.value(rounded(each.p99_us, 3));
        w.end_object();
    }
    w.end_array();
}

} // namespace

std::vector<task_time> task_times_in(const json_node& metrics) {
    std::vector<task_time> out;
    if (const auto* const tasks = metrics.find("tasks_us"); tasks != nullptr) {
        for (const auto& [task, verbs] : tasks->members) {
            for (const auto& [verb, times] : verbs.members) {
                out.push_back({.task = task,
                               .verb = verb,
                               .samples = number_in<std::uint64_t>(times.find("samples")).value_or(0),
                               .p50_us = number_in<double>(times.find("p50")).value_or(0),
                               .p99_us = number_in<double>(times.find("p99")).value_or(0)});
            }
        }
    }
    return out;
}

node_rate node_rates::update(const std::string& run, const json_node& document, time_point now) {
    counters current{.when = now};
    if (const auto* requests = document.find("requests"); requests != nullptr) {
        for (const auto& [verb, count] : requests->members) {
            current.requests += number_in<std::uint64_t>(&count).value_or(0);
        }
    }
    current.errors = number_in<std::uint64_t>(document.find("errors")).value_or(0);

    node_rate out{.moved_out =
                      number_in<std::uint64_t>(document.find("jobs_moved_out")).value_or(0), // left out where it is 0
                  .moved_in = number_in<std::uint64_t>(document.find("jobs_moved_in")).value_or(0)};
    if (const auto* times = document.find("handler_us");
        times != nullptr && number_in<std::uint64_t>(times->find("samples")).value_or(0) > 0) {
        out.p50_us = number_in<double>(times->find("p50"));
        out.p99_us = number_in<double>(times->find("p99"));
    }
    const auto before = last_.find(run);
    if (before != last_.end() && now > before->second.when) {
        const auto seconds = std::chrono::duration<double>{now - before->second.when}.count();
        out.requests =
            per_second(before->second.requests + 1, current.requests, seconds); // one of them was this request
        out.errors = per_second(before->second.errors, current.errors, seconds);
    }
    last_[run] = current;
    return out;
}

void node_rates::remove_before(time_point when) {
    std::erase_if(last_, [&](const auto& each) { return each.second.when < when; });
}

void sort_rows(std::vector<top_row>& rows, top_order order) {
    const auto rank = [&](const top_row& row) {
        const auto first = order == top_order::load ? -jobs_per_worker(row) : 0.0;
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
    table out{"NODE", "STATE", "WORKERS", "RUNNING", "QUEUED", "OUT",
              "IN",   "REQ/S", "ERR/S",   "P50",     "P99",    "LAST SEEN"};
    const auto number = [&](std::size_t column, std::string text) { out.set(column, std::move(text), true); };
    for (const auto& row : rows) {
        const auto& node = row.node;
        out.row();
        out.set(0, printable(node.node));
        out.set(1, printable(node.state));
        number(2, node.load && node.load->workers != 0 ? std::to_string(node.load->workers) : "-");
        number(3, node.load ? std::to_string(node.load->running) : "-");
        number(4, node.load ? std::to_string(node.load->queued) : "-");
        number(5, row.rate.moved_out ? std::to_string(*row.rate.moved_out) : "-");
        number(6, row.rate.moved_in ? std::to_string(*row.rate.moved_in) : "-");
        number(7, number_text(row.rate.requests, 0));
        number(8, number_text(row.rate.errors, 0));
        number(9, time_text(row.rate.p50_us));
        number(10, time_text(row.rate.p99_us));
        out.set(11, node.last_seen() + (node.error.empty() ? "" : " (" + printable(node.error) + ")"));
    }
    return out.text();
}

std::string tasks_to_table(const std::vector<top_row>& rows) {
    std::vector<std::pair<const top_row*, const task_time*>> all;
    for (const auto& row : rows) {
        for (const auto& each : row.tasks) {
            all.emplace_back(&row, &each);
        }
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const auto& a, const auto& b) { return a.second->p99_us > b.second->p99_us; });
    table out{"NODE", "VERB", "TASK", "SAMPLES", "P50", "P99"};
    for (const auto& [row, each] : all) {
        out.row();
        out.set(0, printable(row->node.node));
        out.set(1, printable(each->verb));
        out.set(2, printable(each->task));
        out.set(3, std::to_string(each->samples), true);
        out.set(4, time_text(each->p50_us), true);
        out.set(5, time_text(each->p99_us), true);
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
        if (!row.node.pool.empty()) {
            w.key("pool");
            w.value(std::string_view{row.node.pool});
        }
        w.key("state");
        w.value(std::string_view{row.node.state});
        if (row.node.load) {
            w.key("load");
            write_load(w, *row.node.load);
        }
        write_count(w, "jobs_moved_out", row.rate.moved_out);
        write_count(w, "jobs_moved_in", row.rate.moved_in);
        write_rate(w, "requests_per_s", row.rate.requests);
        write_rate(w, "errors_per_s", row.rate.errors);
        write_rate(w, "handler_p50_us", row.rate.p50_us);
        write_rate(w, "handler_p99_us", row.rate.p99_us);
        if (!row.tasks.empty()) {
            write_tasks(w, row.tasks);
        }
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
