// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tool {

/// A JSON value to be shown. Unlike a document tree made for computing it keeps each number as it was written.
struct json_node {
    enum class type { object, array, text, other };

    type kind = type::other;
    std::string text{}; ///< a string's content; of everything else its JSON
    std::vector<std::pair<std::string, json_node>> members{};
    std::vector<json_node> elements{};

    /// An array that holds objects alone, and at least one.
    [[nodiscard]] bool is_list_of_objects() const;
    /// The member of that name, or null.
    [[nodiscard]] const json_node* find(std::string_view name) const;
};

/// \throws cles::error with `conversion` where it is not JSON
json_node parse_json(std::string_view json);

/// One value of an object, nested ones included: {"a":{"b":1}} has "a.b".
struct json_cell {
    std::string path;
    std::string text;
    bool is_number = false;
};

/// An object's values in their order, fit for a terminal. An array is one value; one of objects alone stays JSON.
std::vector<json_cell> flatten(const json_node& object);

} // namespace tool
