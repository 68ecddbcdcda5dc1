// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>

namespace tool {

/// 1 to 64 letters, digits, '_', '-', '.'
bool is_name(std::string_view text);

/// The node that a noun names.
std::string_view target_of(std::string_view noun);

/// Checks a noun such as "car1:localization/fast" before anything is sent.
/// \throws usage_error that says what is wrong with it
void check_noun(std::string_view noun);

/// The JSON body that -d stands for: the text itself, "@FILE" or "-" for stdin; validated, and on one line.
/// \throws usage_error that says what is wrong, and where
std::string read_body(const std::string& argument);

} // namespace tool
