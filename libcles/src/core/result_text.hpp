// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <string>

namespace cles::core {

/// Turns what a handler has written from `start` on into a body: nothing becomes {}, a scalar {"value":x}.
inline void close_result(std::string& out, std::size_t start) {
    if (out.size() == start) {
        out.append("{}");
    } else if (out[start] != '{' && out[start] != '[') {
        out.insert(start, R"({"value":)");
        out.push_back('}');
    }
}

} // namespace cles::core
