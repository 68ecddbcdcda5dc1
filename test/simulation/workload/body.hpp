// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <charconv>
#include <cstdint>
#include <string_view>

namespace cles::simulation {

/// The content of simulated bodies: the number that follows such a text; 0 if there is none.
inline std::uint64_t number_after(std::string_view json, std::string_view text) {
    const auto at = json.find(text);
    std::uint64_t value = 0;
    if (at != std::string_view::npos) {
        std::from_chars(json.data() + at + text.size(), json.data() + json.size(), value);
    }
    return value;
}

/// Whether a body belongs to this request.
inline bool speaks_of(std::string_view json, std::uint32_t op) {
    return json.starts_with("{\"op\":") && number_after(json, "{\"op\":") == op;
}

} // namespace cles::simulation
