// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tool {

/// Of the words that exist the one that was probably meant: few letters away, or begun so. Empty where none is near.
std::string closest(std::string_view typed, const std::vector<std::string>& known);

} // namespace tool
