// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace tool {

/// The JSON body that -d stands for: the text itself, "@FILE" or "-" for stdin; on one line, checked.
/// \throws usage_error that says what is wrong, where
std::string read_body(const std::string& argument);

} // namespace tool
