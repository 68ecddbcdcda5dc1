// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tool {

/// The known word that was probably meant: at a small edit distance, or with this beginning. Empty if there is none.
std::string closest_match(std::string_view typed, const std::vector<std::string>& known);

} // namespace tool
