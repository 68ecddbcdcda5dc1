// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>

namespace cles {

/// The library's version (semantic versioning). The protocol's version is 1.
inline constexpr std::string_view version = "1.0.0";

} // namespace cles
