// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>

namespace cles::security {

/// Whether the text has the form of the pattern, in which each `any` stands for any characters, also none. It takes
/// time in proportion to the lengths, and allocates nothing.
[[nodiscard]] bool matches_wildcard(std::string_view pattern, std::string_view text, char any) noexcept;

/// Whether this is the pattern of a name: the characters of names and `*`, but not two `*` in a row.
[[nodiscard]] bool is_name_pattern(std::string_view text) noexcept;

/// Whether the pattern of a name, which must be valid, fits this one.
[[nodiscard]] inline bool matches_name(std::string_view pattern, std::string_view name) noexcept {
    return matches_wildcard(pattern, name, '*');
}

} // namespace cles::security
