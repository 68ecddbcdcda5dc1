// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <chrono>

namespace tool {

/// What is left until then; where nothing is, a moment, since a deadline of zero would be the default.
inline std::chrono::milliseconds time_left(std::chrono::steady_clock::time_point until) {
    return std::max(std::chrono::milliseconds{1},
                    std::chrono::duration_cast<std::chrono::milliseconds>(until - std::chrono::steady_clock::now()));
}

} // namespace tool
