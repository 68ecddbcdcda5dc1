// SPDX-License-Identifier: BSL-1.0
#include "table.hpp"

#include "terminal.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace tool {
namespace {

constexpr std::size_t gap = 2;

std::string padded(std::string text, std::size_t width, bool right) {
    const auto taken = width_of(text);
    if (taken < width) {
        text.insert(right ? 0 : text.size(), width - taken, ' ');
    }
    return text;
}

void append_line(std::string& out, std::string line, bool is_header) {
    line.erase(line.find_last_not_of(' ') + 1);
    out.append(is_header ? bold(stream::out, line) : line).append("\n");
}

std::string key_value_lines(const std::vector<json_cell>& cells) {
    std::size_t width = 0;
    for (const auto& cell : cells) {
        width = std::max(width, width_of(cell.path));
    }
    std::string out;
    for (const auto& cell : cells) {
        out.append(bold(stream::out, cell.path)).append(width - width_of(cell.path) + gap, ' ').append(cell.text);
        out.append("\n");
    }
    return out;
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

std::size_t table::column(std::string_view title) {
    const auto at = std::find_if(heads_.begin(), heads_.end(), [&](const head& h) { return h.title == title; });
    if (at == heads_.end()) {
        heads_.push_back({std::string{title}, width_of(title)});
        return heads_.size() - 1;
    }
    return static_cast<std::size_t>(at - heads_.begin());
}

void table::set(std::size_t column, std::string text, bool is_number) {
    auto& cells = rows_.back();
    cells.resize(std::max(cells.size(), column + 1));
    heads_[column].width = std::max(heads_[column].width, width_of(text));
    heads_[column].numbers = heads_[column].numbers && is_number;
    cells[column] = std::move(text);
}

std::string table::text() const {
    const std::string between(gap, ' ');
    std::string out;
    std::string line;
    for (const auto& h : heads_) {
        line += padded(h.title, h.width, h.numbers) + between;
    }
    append_line(out, std::move(line), true);
    for (const auto& cells : rows_) {
        line.clear();
        for (std::size_t i = 0; i < cells.size(); ++i) {
            line += padded(cells[i], heads_[i].width, heads_[i].numbers) + between;
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

std::string row_view::add(std::string_view json, std::string_view first) {
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
    if (!first.empty()) {
        cells.insert(cells.begin(), {"seq", std::string{first}, true});
    }

    std::string out;
    const bool same = std::equal(cells.begin(), cells.end(), heads_.begin(), heads_.end(),
                                 [](const json_cell& cell, const head& h) { return cell.path == h.title; });
    if (!same) {
        out.append(heads_.empty() ? "" : "\n");
        heads_.clear();
        std::string line;
        for (const auto& cell : cells) {
            heads_.push_back({cell.path, std::max(width_of(cell.path), width_of(cell.text))});
            line += padded(cell.path, heads_.back().width + gap, false);
        }
        append_line(out, std::move(line), true);
    }
    std::string line;
    for (std::size_t i = 0; i < cells.size(); ++i) {
        heads_[i].width = std::max(heads_[i].width, width_of(cells[i].text));
        line += padded(std::move(cells[i].text), heads_[i].width + gap, false);
    }
    append_line(out, std::move(line), false);
    return out;
}

} // namespace tool
