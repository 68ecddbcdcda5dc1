// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "output/json_node.hpp"

#include <cstddef>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace tool {

/// The title and the width of a column.
struct table_header {
    std::string title;
    std::size_t width = 0;
    bool numbers = true; ///< only numbers: aligned at the right
};

/// Columns with aligned cells under a header.
class table {
  public:
    table() = default;
    table(std::initializer_list<const char*> titles);

    /// Finds the column of that title, or adds it at the right.
    std::size_t column(std::string_view title);
    /// Begins a row; cells that are not set stay empty.
    void row() { rows_.emplace_back(); }
    void set(std::size_t column, std::string text, bool is_number = false);

    [[nodiscard]] std::string text() const;

  private:
    std::vector<table_header> headers_;
    std::vector<std::vector<std::string>> rows_;
};

/// The table of an array of objects: a column for each path that occurs.
table table_of(const json_node& objects);

/// A JSON document for people: an object as "key  value" lines; arrays of objects, alone or in it, as tables.
std::string to_table(std::string_view json);

/// Successive documents as rows under one header, which is repeated when their keys change, and when a value is wider
/// than its column.
class row_printer {
  public:
    /// The document's lines, with these cells before its own values.
    std::string add(std::string_view json, std::vector<json_cell> leading = {});

  private:
    [[nodiscard]] bool fits(const std::vector<json_cell>& cells) const;
    [[nodiscard]] std::string line_of(const std::vector<json_cell>& cells) const;

    std::vector<table_header> headers_;
};

} // namespace tool
