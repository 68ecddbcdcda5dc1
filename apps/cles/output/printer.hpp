// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "output/table.hpp"

#include <string_view>
#include <vector>

namespace CLI {
class App;
}

namespace tool {

enum class output_format { automatic, table, json, raw };

/// -o: table, json or raw.
void add_output_option(CLI::App& command, output_format& format);

/// -o of commands whose table is text, also if it is not on a terminal, and whose documents are their own.
void add_json_option(CLI::App& command, bool& json, const std::string& documents);

/// The format, where `automatic` means a table on a terminal, and JSON otherwise.
output_format resolved(output_format format);

/// Prints JSON documents on stdout in the format that was requested.
class printer {
  public:
    /// `stream`: several documents follow each other, so that a table has one header, and a row for each.
    printer(output_format format, bool stream) : format_(resolved(format)), stream_(stream) {}

    /// `leading`: cells before those of the document in a row of a table.
    void print(std::string_view json, std::vector<json_cell> leading = {});

  private:
    output_format format_;
    bool stream_;
    row_printer rows_;
};

} // namespace tool
