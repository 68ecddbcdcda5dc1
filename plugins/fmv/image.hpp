// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace fmv {

/// How large a picture is, in pixels.
struct extent {
    int width = 0;
    int height = 0;

    [[nodiscard]] std::size_t pixels() const noexcept {
        return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    }
    [[nodiscard]] std::size_t at(int x, int y) const noexcept {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    }
    bool operator==(const extent&) const = default;
};

/// Grey pixels, row by row.
using grey = std::vector<std::uint8_t>;

struct point {
    double x = 0;
    double y = 0;
};

} // namespace fmv
