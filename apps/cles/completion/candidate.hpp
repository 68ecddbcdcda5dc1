// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace tool {

/// Something that may be typed next. Where it ends in ':', '/', '=' or '@', more is to follow without a space.
struct candidate {
    std::string text;
    std::string about{}; ///< a few words for shells that show them
};

} // namespace tool
