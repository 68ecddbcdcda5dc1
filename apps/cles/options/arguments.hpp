// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>

namespace tool {

/// Checks what the user gave as a noun, before anything is sent: "car1:localization/fast".
/// \throws usage_error that says what is wrong with it
void check_noun(std::string_view noun);

bool is_name(std::string_view text);

/// The node that a noun names.
std::string_view target_of(std::string_view noun);

} // namespace tool
