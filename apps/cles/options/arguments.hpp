// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>

namespace tool {

/// 1 to 64 letters, digits, '_', '-', '.'
bool is_name(std::string_view text);

/// Whether it is the name of no node, but stands for others: self, any or all.
inline bool stands_for_others(std::string_view name) noexcept {
    return name == "self" || name == "any" || name == "all";
}

/// The node that a noun names.
std::string_view target_of(std::string_view noun);

/// Checks a noun such as "car1:localization/fast" before anything is sent.
/// \throws usage_error that says what is wrong with it
void check_noun(std::string_view noun);

/// The same for a pattern of nouns, in which `*` may stand for characters; see `noun_pattern`.
void check_noun_pattern(std::string_view pattern);

/// The JSON body that -d stands for: the text itself, "@FILE" or "-" for stdin; validated, and on one line.
/// \throws usage_error that says what is wrong, and where
std::string read_body(const std::string& argument);

/// The same for a text, which `origin` names in messages.
std::string checked_body(std::string_view text, const std::string& origin);

} // namespace tool
