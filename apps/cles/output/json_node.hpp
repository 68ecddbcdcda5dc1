// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tool {

/// A JSON value to display. It keeps each number as it was written.
struct json_node {
    enum class type { object, array, text, other };

    type kind = type::other;
    std::string text{}; ///< the content of a string; the JSON of other scalars
    std::vector<std::pair<std::string, json_node>> members{};
    std::vector<json_node> elements{};

    /// A non-empty array of objects only.
    [[nodiscard]] bool is_list_of_objects() const;
    /// The member of that name, or null.
    [[nodiscard]] const json_node* find(std::string_view name) const;
};

/// \throws cles::error with `conversion` if it is not JSON
json_node parse_json(std::string_view json);

/// One value of an object, nested ones included: {"a":{"b":1}} has "a.b".
struct json_cell {
    std::string path;
    std::string text;
    bool is_number = false;
};

/// An object's values in their order, safe for a terminal. An array is one value; an array of objects stays JSON.
std::vector<json_cell> flatten(const json_node& object);

} // namespace tool
