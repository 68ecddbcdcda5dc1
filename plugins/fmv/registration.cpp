// SPDX-License-Identifier: BSL-1.0
#include "registration.hpp"

#include <cstdlib>
#include <limits>

namespace fmv {
namespace {

constexpr int grid = 5;

std::int64_t difference(const grey& reference, const grey& picture, extent size, shift by) {
    std::int64_t sum = 0;
    for (int y = most_shift; y < size.height - most_shift; y += grid) {
        for (int x = most_shift; x < size.width - most_shift; x += grid) {
            sum += std::abs(picture[size.at(x, y)] - reference[size.at(x + by.dx, y + by.dy)]);
        }
    }
    return sum;
}

} // namespace

shift register_with(const grey& reference, const grey& picture, extent size) {
    shift best;
    auto least = std::numeric_limits<std::int64_t>::max();
    for (int dy = -most_shift; dy <= most_shift; ++dy) {
        for (int dx = -most_shift; dx <= most_shift; ++dx) {
            if (const auto d = difference(reference, picture, size, {dx, dy}); d < least) {
                least = d;
                best = {dx, dy};
            }
        }
    }
    return best;
}

void align(const grey& reference, grey& picture, extent size, shift by) {
    if (by == shift{}) {
        return;
    }
    grey moved = reference;
    for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
            const int to_x = x + by.dx;
            const int to_y = y + by.dy;
            if (to_x >= 0 && to_y >= 0 && to_x < size.width && to_y < size.height) {
                moved[size.at(to_x, to_y)] = picture[size.at(x, y)];
            }
        }
    }
    picture.swap(moved);
}

} // namespace fmv
