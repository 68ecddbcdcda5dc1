// SPDX-License-Identifier: BSL-1.0
#include "registration.hpp"

#include <algorithm>
#include <cstdlib>
#include <limits>

namespace fmv {
namespace {

constexpr int grid = 5;

double difference(const grey& reference, const rectified& picture, extent size, shift by) {
    std::int64_t sum = 0;
    std::int64_t count = 0;
    for (int y = most_shift; y < size.height - most_shift; y += grid) {
        for (int x = most_shift; x < size.width - most_shift; x += grid) {
            const auto i = size.at(x, y);
            const int d = picture.pixels[i] - reference[size.at(x + by.dx, y + by.dy)];
            sum += picture.seen[i] != 0 ? std::abs(d) : 0;
            count += picture.seen[i];
        }
    }
    return static_cast<double>(sum) / static_cast<double>(std::max<std::int64_t>(count, 1));
}

grey moved(const grey& from, extent size, shift by) {
    grey out(size.pixels());
    for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
            const int to_x = x + by.dx;
            const int to_y = y + by.dy;
            if (to_x >= 0 && to_y >= 0 && to_x < size.width && to_y < size.height) {
                out[size.at(to_x, to_y)] = from[size.at(x, y)];
            }
        }
    }
    return out;
}

} // namespace

shift register_with(const grey& reference, const rectified& picture, extent size) {
    shift best;
    auto least = std::numeric_limits<double>::infinity();
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

void align(rectified& picture, extent size, shift by) {
    if (by != shift{}) {
        picture = {.pixels = moved(picture.pixels, size, by), .seen = moved(picture.seen, size, by)};
    }
}

} // namespace fmv
