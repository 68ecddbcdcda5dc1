// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tool {

/// The words of a command, as a shell splits them: at blanks, which '...' and "..." and \ keep. Nothing is expanded,
/// and no shell runs. \throws usage_error if there is no word, or a quotation does not end
std::vector<std::string> words_of_command(std::string_view command);

} // namespace tool
