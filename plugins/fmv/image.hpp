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

/// Between pixels, bilinear. \param i the upper left one of the four \param u, v to the right and down of it, 0 to 1
template <class Pixel>
float between_pixels(const std::vector<Pixel>& pixels, extent size, std::size_t i, float u, float v) {
    const auto value = [&pixels](std::size_t k) { return static_cast<float>(pixels[k]); };
    const auto below = i + static_cast<std::size_t>(size.width);
    const float upper = value(i) + (value(i + 1) - value(i)) * u;
    const float lower = value(below) + (value(below + 1) - value(below)) * u;
    return upper + (lower - upper) * v;
}

} // namespace fmv
