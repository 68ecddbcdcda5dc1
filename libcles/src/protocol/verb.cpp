// SPDX-License-Identifier: BSL-1.0
#include <cles/verb.hpp>

namespace cles {

std::optional<verb> verb_from(std::string_view text) noexcept {
    const auto upper = [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c; };
    for (std::size_t i = 0; i < verb_count; ++i) {
        const auto name = verb_names[i];
        if (text.size() != name.size()) {
            continue;
        }
        std::size_t same = 0;
        while (same < name.size() && upper(text[same]) == name[same]) {
            ++same;
        }
        if (same == name.size()) {
            return static_cast<verb>(i);
        }
    }
    return std::nullopt;
}

} // namespace cles
