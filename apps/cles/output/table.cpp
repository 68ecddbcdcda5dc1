// SPDX-License-Identifier: BSL-1.0
#include "output/table.hpp"

#include "output/terminal.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace tool {
namespace {

constexpr std::size_t gap = 2;

void append_line(std::string& out, std::string line, bool is_header) {
    line.erase(line.find_last_not_of(' ') + 1);
    out.append(is_header ? bold(stream::out, line) : line).append("\n");
}

// Values are aligned as a column is: at the right where all are numbers.
std::string key_value_lines(const std::vector<json_cell>& cells) {
    std::size_t width = 0;
    std::size_t value_width = 0;
    bool numbers = true;
    for (const auto& cell : cells) {
        width = std::max(width, width_of(cell.path));
        value_width = std::max(value_width, width_of(cell.text));
        numbers = numbers && cell.is_number;
    }
    std::string out;
    for (const auto& cell : cells) {
        out.append(bold(stream::out, cell.path)).append(width - width_of(cell.path) + gap, ' ');
        out.append(numbers ? padded(cell.text, value_width, true) : cell.text).append("\n");
    }
    return out;
}

// Later values may be longer: a decimal with more digits, a counter that has grown.
std::size_t reserved_width(const json_cell& cell) {
    constexpr std::size_t more_digits = 3;
    const bool grows = cell.text.find('.') != std::string::npos || cell.text.size() > 2 * more_digits;
    return width_of(cell.text) + (cell.is_number && grows ? more_digits : 0);
}

std::string object_text(json_node object) {
    // Lists come last, as tables of their own.
    const auto is_list = [](const auto& member) { return member.second.is_list_of_objects(); };
    const auto lists_begin =
        std::stable_partition(object.members.begin(), object.members.end(), [&](const auto& m) { return !is_list(m); });
    const std::vector<std::pair<std::string, json_node>> lists{std::make_move_iterator(lists_begin),
                                                               std::make_move_iterator(object.members.end())};
    object.members.erase(lists_begin, object.members.end());

    std::string out = key_value_lines(flatten(object));
    for (const auto& [name, list] : lists) {
        out.append(out.empty() ? "" : "\n");
        append_line(out, printable(name) + ":", true);
        out.append(table_of(list).text());
    }
    return out;
}

} // namespace

table::table(std::initializer_list<const char*> titles) {
    for (const char* title : titles) {
        column(title);
    }
}

std::size_t table::column(std::string_view title) {
    const auto at =
        std::find_if(headers_.begin(), headers_.end(), [&](const table_header& h) { return h.title == title; });
    if (at == headers_.end()) {
        headers_.push_back({std::string{title}, width_of(title)});
        return headers_.size() - 1;
    }
    return static_cast<std::size_t>(at - headers_.begin());
}

void table::set(std::size_t column, std::string text, bool is_number) {
    auto& cells = rows_.back();
    cells.resize(std::max(cells.size(), column + 1));
    headers_[column].width = std::max(headers_[column].width, width_of(text));
    headers_[column].numbers = headers_[column].numbers && is_number;
    cells[column] = std::move(text);
}

std::string table::text() const {
    const std::string between(gap, ' ');
    std::string out;
    std::string line;
    for (const auto& h : headers_) {
        line += padded(h.title, h.width, h.numbers) + between;
    }
    append_line(out, std::move(line), true);
    for (const auto& cells : rows_) {
        line.clear();
        for (std::size_t i = 0; i < cells.size(); ++i) {
            line += padded(cells[i], headers_[i].width, headers_[i].numbers) + between;
        }
        append_line(out, std::move(line), false);
    }
    return out;
}

table table_of(const json_node& objects) {
    table out;
    for (const auto& element : objects.elements) {
        out.row();
        for (auto& cell : flatten(element)) {
            out.set(out.column(cell.path), std::move(cell.text), cell.is_number);
        }
    }
    return out;
}

std::string to_table(std::string_view json) {
    auto node = parse_json(json);
    if (node.is_list_of_objects()) {
        return table_of(node).text();
    }
    if (node.kind == json_node::type::object && !node.members.empty()) {
        return object_text(std::move(node));
    }
    if (node.kind != json_node::type::array || node.elements.empty()) {
        return std::string{json} + "\n";
    }
    std::string out;
    for (auto& element : node.elements) {
        json_node holder{.kind = json_node::type::object};
        holder.members.emplace_back("", std::move(element));
        for (const auto& cell : flatten(holder)) {
            out.append(cell.text).append("\n");
        }
    }
    return out;
}

bool row_printer::fits(const std::vector<json_cell>& cells) const {
    return std::equal(cells.begin(), cells.end(), headers_.begin(), headers_.end(),
                      [](const json_cell& cell, const table_header& h) {
                          return cell.path == h.title && width_of(cell.text) <= h.width;
                      });
}

std::string row_printer::line_of(const std::vector<json_cell>& cells) const {
    std::string line;
    for (std::size_t i = 0; i < cells.size(); ++i) {
        line += padded(cells[i].text, headers_[i].width, headers_[i].numbers) + std::string(gap, ' ');
    }
    return line;
}

std::string row_printer::add(std::string_view json, std::vector<json_cell> leading) {
    auto node = parse_json(json);
    if (node.kind != json_node::type::object) {
        json_node holder{.kind = json_node::type::object};
        holder.members.emplace_back("value", std::move(node));
        node = std::move(holder);
    }
    auto cells = flatten(node);
    if (cells.empty()) {
        return std::string{json} + "\n";
    }
    cells.insert(cells.begin(), std::make_move_iterator(leading.begin()), std::make_move_iterator(leading.end()));

    std::string out;
    if (!fits(cells)) {
        out.append(headers_.empty() ? "" : "\n");
        std::vector<json_cell> titles;
        std::vector<table_header> headers;
        for (const auto& cell : cells) {
            // A column never becomes narrower; otherwise rows of several publishers would repeat the header each time.
            const auto before = std::find_if(headers_.begin(), headers_.end(),
                                             [&](const table_header& h) { return h.title == cell.path; });
            const auto width = before == headers_.end() ? 0 : before->width;
            headers.push_back(
                {cell.path, std::max({width_of(cell.path), reserved_width(cell), width}), cell.is_number});
            titles.push_back({cell.path, cell.path, false});
        }
        headers_ = std::move(headers);
        append_line(out, line_of(titles), true);
    }
    append_line(out, line_of(cells), false);
    return out;
}

} // namespace tool
