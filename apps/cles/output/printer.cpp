// SPDX-License-Identifier: BSL-1.0
#include "output/printer.hpp"

#include <cles/json_reader.hpp>

#include "output/terminal.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <functional>
#include <map>
#include <string>
#include <utility>

namespace tool {

namespace {

// All commands accept the same formats. `text` is an earlier name of `table`.
void add_format(CLI::App& command, std::function<void(output_format)> choose, const std::string& help) {
    static const std::map<std::string, output_format> names{{"table", output_format::table},
                                                            {"text", output_format::table},
                                                            {"json", output_format::json},
                                                            {"raw", output_format::raw}};
    command
        .add_option_function<std::string>(
            "-o,--output", [choose = std::move(choose)](const std::string& name) { choose(names.at(name)); }, help)
        ->type_name("FORMAT")
        ->check(CLI::IsMember({"table", "json", "raw", "text"}).description(""));
}

} // namespace

void add_output_option(CLI::App& command, output_format& format) {
    add_format(
        command, [&format](output_format chosen) { format = chosen; },
        "table, json (one document per line) or raw (as received); default: table on a terminal, otherwise json");
}

void add_json_option(CLI::App& command, bool& json, const std::string& documents) {
    add_format(
        command, [&json](output_format chosen) { json = chosen != output_format::table; },
        "table, json or raw: " + documents + " (default table)");
}

output_format resolved(output_format format) {
    if (format != output_format::automatic) {
        return format;
    }
    return is_terminal(stream::out) ? output_format::table : output_format::json;
}

void printer::print(std::string_view json, std::vector<json_cell> leading) {
    std::string text;
    switch (format_) {
    case output_format::raw: text.append(json).append("\n"); break;
    case output_format::table: text = stream_ ? rows_.add(json, std::move(leading)) : to_table(json); break;
    case output_format::json:
    case output_format::automatic:
        cles::append_compact_json(json, text);
        text.append("\n");
        break;
    }
    write_output(text);
}

} // namespace tool
