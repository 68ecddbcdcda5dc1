// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>

namespace tool {

/// Says on stderr what went wrong, as "cles: TEXT".
void complain(std::string_view text);

/// Says on stderr what the user should know though nothing failed, as "cles: TEXT".
void note(std::string_view text);

} // namespace tool
