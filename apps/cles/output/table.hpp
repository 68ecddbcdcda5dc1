// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "output/json_node.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace tool {

/// Columns with aligned cells under a header.
class table {
  public:
    /// Adds a column at the right, or finds it.
    std::size_t column(std::string_view title);
    /// Begins a row; cells that are not set stay empty.
    void row() { rows_.emplace_back(); }
    void set(std::size_t column, std::string text, bool is_number = false);

    [[nodiscard]] std::string text() const;

  private:
    struct head {
        std::string title;
        std::size_t width = 0;
        bool numbers = true; ///< so far nothing but numbers: aligned at the right
    };

    std::vector<head> heads_;
    std::vector<std::vector<std::string>> rows_;
};

/// The table of an array of objects: a column for each path that occurs.
table table_of(const json_node& objects);

/// A JSON document for people: an object as "key  value" lines, and arrays of objects, in it or alone, as tables.
std::string to_table(std::string_view json);

/// Documents that follow each other as rows under one header, which is repeated when their keys change, and when a
/// value is wider than its column.
class row_view {
  public:
    /// The document's lines, with these cells before its own values.
    std::string add(std::string_view json, std::vector<json_cell> leading = {});

  private:
    struct head {
        std::string title;
        std::size_t width = 0;
        bool numbers = false; ///< aligned at the right
    };

    [[nodiscard]] bool fits(const std::vector<json_cell>& cells) const;
    [[nodiscard]] std::string line_of(const std::vector<json_cell>& cells) const;

    std::vector<head> heads_;
};

} // namespace tool
