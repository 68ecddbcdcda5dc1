// SPDX-License-Identifier: BSL-1.0
#include "output/json_node.hpp"

#include <cles/error.hpp>
#include <cles/json_reader.hpp>

#include "output/terminal.hpp"

#include <algorithm>

namespace tool {
namespace {

bool read(cles::json_reader& r, json_node& node);

bool read_scalar(cles::json_reader& r, json_node& node) {
    if (r.peek() == cles::json_reader::kind::string) {
        node.kind = json_node::type::text;
        return r.read(node.text);
    }
    std::string_view raw;
    node.kind = json_node::type::other;
    const bool good = r.read_raw(raw);
    node.text = raw;
    return good;
}

bool read_object(cles::json_reader& r, json_node& node) {
    node.kind = json_node::type::object;
    std::string_view key;
    if (!r.begin_object()) {
        return false;
    }
    while (r.next_key(key)) {
        if (!read(r, node.members.emplace_back(std::string{key}, json_node{}).second)) {
            return false;
        }
    }
    return r.ok();
}

bool read_array(cles::json_reader& r, json_node& node) {
    node.kind = json_node::type::array;
    if (!r.begin_array()) {
        return false;
    }
    while (r.next_element()) {
        if (!read(r, node.elements.emplace_back())) {
            return false;
        }
    }
    return r.ok();
}

bool read(cles::json_reader& r, json_node& node) {
    switch (r.peek()) {
    case cles::json_reader::kind::object: return read_object(r, node);
    case cles::json_reader::kind::array: return read_array(r, node);
    default: return read_scalar(r, node);
    }
}

std::string inline_text(const json_node& node, bool outermost) {
    switch (node.kind) {
    case json_node::type::text: return outermost ? printable(node.text) : "\"" + printable(node.text) + "\"";
    case json_node::type::other: return node.text;
    case json_node::type::object: {
        std::string out = "{";
        for (const auto& [name, value] : node.members) {
            out.append(out.size() > 1 ? ", " : "")
                .append(printable(name))
                .append(": ")
                .append(inline_text(value, false));
        }
        return out + "}";
    }
    case json_node::type::array: break;
    }
    const bool plain = outermost && !node.elements.empty() &&
                       std::all_of(node.elements.begin(), node.elements.end(), [](const json_node& e) {
                           return e.kind == json_node::type::text || e.kind == json_node::type::other;
                       });
    std::string out;
    for (const auto& element : node.elements) {
        out.append(out.empty() ? "" : ", ").append(inline_text(element, plain));
    }
    return plain ? out : "[" + out + "]";
}

bool is_number(const json_node& node) {
    return node.kind == json_node::type::other &&
           (node.text.front() == '-' || (node.text.front() >= '0' && node.text.front() <= '9'));
}

void flatten_into(const json_node& object, const std::string& prefix, std::vector<json_cell>& out) {
    for (const auto& [name, value] : object.members) {
        const auto path = prefix + printable(name);
        if (value.kind == json_node::type::object && !value.members.empty()) {
            flatten_into(value, path + ".", out);
        } else {
            out.push_back({path, inline_text(value, true), is_number(value)});
        }
    }
}

} // namespace

bool json_node::is_list_of_objects() const {
    return kind == type::array && !elements.empty() &&
           std::all_of(elements.begin(), elements.end(), [](const json_node& e) { return e.kind == type::object; });
}

const json_node* json_node::find(std::string_view name) const {
    const auto at = std::find_if(members.begin(), members.end(), [&](const auto& m) { return m.first == name; });
    return at != members.end() ? &at->second : nullptr;
}

json_node parse_json(std::string_view json) {
    cles::json_reader reader{json};
    json_node node;
    if (!read(reader, node) || !reader.at_end()) {
        throw cles::error(cles::errc::conversion, "the reply is not valid JSON: " + reader.error());
    }
    return node;
}

std::vector<json_cell> flatten(const json_node& object) {
    std::vector<json_cell> out;
    flatten_into(object, "", out);
    return out;
}

} // namespace tool
