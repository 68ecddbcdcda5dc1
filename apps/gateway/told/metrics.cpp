// SPDX-License-Identifier: BSL-1.0
#include "gateway/told/metrics.hpp"

#include <cles/convert.hpp>
#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "gateway/http/message.hpp"
#include "gateway/told/told_limits.hpp"

#include <cstddef>
#include <span>
#include <utility>

namespace gateway {
namespace {

constexpr std::size_t deepest = 8;
constexpr std::string_view counter_suffix = "_total";

constexpr std::string_view metrics_page =
#include "metrics.md.inc"
    ;

constexpr metric other_values{.name = "cles_value",
                              .kind = "gauge",
                              .path = {},
                              .label = {},
                              .help = "A number of the program's own metrics, or of a later version, by its member"};

// Without the marks of code.
std::string_view plain_cell(std::string_view cell) noexcept {
    return cell.size() >= 2 && cell.front() == '`' ? cell.substr(1, cell.size() - 2) : cell;
}

std::vector<metric> read_table() {
    std::vector<metric> rows;
    for (auto left = metrics_page; !left.empty();) {
        auto line = take_part(left, '\n');
        if (!line.starts_with("| `")) {
            continue;
        }
        take_part(line, '|');
        metric row{.name = plain_cell(take_part(line, '|')),
                   .kind = take_part(line, '|'),
                   .path = plain_cell(take_part(line, '|')),
                   .label = plain_cell(take_part(line, '|')),
                   .help = take_part(line, '|')};
        const bool is_time = row.name.ends_with("_seconds") && !row.path.ends_with(".samples");
        if (is_time) {
            row.scale = row.path.find("_ms") != std::string_view::npos ? 1e-3 : 1e-6;
        }
        rows.push_back(row);
    }
    return rows;
}

struct told_value {
    std::string text; ///< as it was written, which keeps all digits
    double number = 0;
};
using told_values = std::map<std::string, told_value, std::less<>>; // by path

// Numbers and booleans of an object, with those of the objects in it. Lists are left out.
// NOLINTNEXTLINE(misc-no-recursion): limited
bool collect_values(cles::json_reader& r, const std::string& before, std::size_t depth, told_values& into) {
    using kind = cles::json_reader::kind;
    std::string_view key;
    bool good = r.begin_object();
    while (good && r.next_key(key)) {
        if (before.size() + key.size() > told_limits::path) {
            good = r.skip();
            continue;
        }
        const auto path = before + std::string{key};
        const auto what = r.peek();
        if (what == kind::object && depth < deepest) {
            good = collect_values(r, path + ".", depth + 1, into);
            continue;
        }
        std::string_view raw;
        good = r.read_raw(raw);
        const bool is_value = what == kind::number || what == kind::boolean;
        if (good && is_value && raw.size() <= told_limits::number && into.size() < told_limits::values) {
            told_value value{.text = std::string{what == kind::number ? raw : raw == "true" ? "1" : "0"}};
            cles::json_reader number{value.text};
            if (number.read(value.number)) {
                into.emplace(path, std::move(value));
            }
        }
    }
    return good && r.ok();
}

std::string escaped_label(std::string_view text) {
    std::string out;
    for (const char c : text) {
        out.append(c == '"' || c == '\\' || c == '\n' ? "\\" : "").push_back(c == '\n' ? 'n' : c);
    }
    return out;
}

void append_family(std::string& out, const metric& of, metrics_format format) {
    auto name = of.name;
    if (of.is_counter() && format == metrics_format::openmetrics) {
        name.remove_suffix(counter_suffix.size());
    }
    out.append("# HELP ").append(name).append(" ").append(of.help).append("\n# TYPE ").append(name);
    out.append(" ").append(of.kind).append("\n");
}

void append_sample(std::string& out, const metric& of, std::string_view node, std::string_view label,
                   const told_value& value) {
    out.append(of.name).append(of.kind == "summary" && label.empty() ? "_count" : "");
    out.append("{node=\"").append(escaped_label(node)).append(label.empty() ? "\"" : "\",").append(label).append("} ");
    out.append(of.scale == 1 ? value.text : cles::to_json(value.number * of.scale)).append("\n");
}

} // namespace

const std::vector<metric>& metric_table() {
    static const auto& rows = *new std::vector<metric>(read_table());
    return rows;
}

metrics_format metrics_format_for(std::string_view accept) noexcept {
    return accept.find("application/openmetrics-text") != std::string_view::npos ? metrics_format::openmetrics
                                                                                 : metrics_format::prometheus;
}

std::string_view type_of(metrics_format format) noexcept {
    return format == metrics_format::openmetrics ? "application/openmetrics-text; version=1.0.0; charset=utf-8"
                                                 : "text/plain; version=0.0.4; charset=utf-8";
}

std::string metrics_text(const std::map<std::string, std::string>& nodes, metrics_format format) {
    std::map<std::string, told_values> values;
    for (const auto& [name, json] : nodes) {
        told_values found;
        cles::json_reader r{json, cles::json_writer::most_levels};
        if (collect_values(r, {}, 1, found)) {
            values.emplace(name, std::move(found));
        }
    }
    std::string out;
    for (std::span<const metric> left{metric_table()}; !left.empty();) {
        std::size_t size = 0;
        while (size < left.size() && left[size].name == left.front().name) {
            ++size;
        }
        std::string samples; // those of one node follow each other, as OpenMetrics demands
        for (auto& [name, all] : values) {
            for (const auto& each : left.first(size)) {
                if (const auto found = all.find(each.path); found != all.end()) {
                    append_sample(samples, each, name, each.label, found->second);
                    all.erase(found);
                }
            }
        }
        if (!samples.empty()) {
            append_family(out, left.front(), format);
            out.append(samples);
        }
        left = left.subspan(size);
    }
    std::string others;
    for (const auto& [name, all] : values) {
        for (const auto& [path, value] : all) {
            append_sample(others, other_values, name, "path=\"" + escaped_label(path) + "\"", value);
        }
    }
    if (!others.empty()) {
        append_family(out, other_values, format);
    }
    return out + others + (format == metrics_format::openmetrics ? "# EOF\n" : "");
}

std::map<std::string, std::string> results_of_all(std::string_view reply) {
    std::map<std::string, std::string> found;
    cles::json_reader r{reply, cles::json_writer::most_levels};
    std::string_view key;
    bool good = r.begin_object();
    while (good && r.next_key(key)) {
        const bool is_wanted = key == "results";
        good = is_wanted ? r.begin_object() : r.skip();
        while (good && is_wanted && r.next_key(key)) {
            if (key.size() > told_limits::node) {
                good = r.skip();
                continue;
            }
            const std::string name{key};
            std::string_view raw;
            good = r.read_raw(raw);
            found.insert_or_assign(name, std::string{raw});
        }
    }
    return good && r.ok() ? found : std::map<std::string, std::string>{};
}

} // namespace gateway
