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

/// The format, `automatic` resolved: a table for a terminal, JSON for everything else.
output_format resolved(output_format format);

/// Shows JSON documents on stdout as the user wants them.
class printer {
  public:
    /// `stream`: several documents are to come, so a table has one header, and a row for each.
    printer(output_format format, bool stream) : format_(resolved(format)), stream_(stream) {}

    /// `leading` is put in front of a row of a table.
    void print(std::string_view json, std::vector<json_cell> leading = {});

  private:
    output_format format_;
    bool stream_;
    row_view rows_;
};

} // namespace tool
