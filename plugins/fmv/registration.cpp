// SPDX-License-Identifier: BSL-1.0
#include "registration.hpp"

#include <cstdint>
#include <cstdlib>
#include <limits>

namespace fmv {
namespace {

constexpr int grid = 5;
constexpr int least_share = 5;       ///< of the pixels of the grid that are seen: a fifth
constexpr double clearly_less = 0.9; ///< than the mean of all shifts. On the ground of the tests it is at most 0.76,
                                     ///< and at least 0.96 for what does not show that ground

// The differences of a picture from the reference.
struct comparison {
    std::int64_t pixels = 0, seen = 0;
    std::int64_t sum = 0;      ///< of differences
    std::int64_t absolute = 0; ///< the same of their absolute values
};

// \param brighter is subtracted from the picture
comparison compare(const grey& reference, const rectified& picture, extent size, shift by, int brighter) {
    comparison out;
    for (int y = most_shift; y < size.height - most_shift; y += grid) {
        for (int x = most_shift; x < size.width - most_shift; x += grid) {
            const auto i = size.at(x, y);
            const int d = picture.pixels[i] - brighter - reference[size.at(x + by.dx, y + by.dy)];
            ++out.pixels;
            out.seen += picture.seen[i];
            out.sum += picture.seen[i] != 0 ? d : 0;
            out.absolute += picture.seen[i] != 0 ? std::abs(d) : 0;
        }
    }
    return out;
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

std::optional<shift> register_with(const grey& reference, const rectified& picture, extent size) {
    const auto all = compare(reference, picture, size, {}, 0);
    if (all.seen * least_share < all.pixels) {
        return std::nullopt;
    }
    const int brighter = static_cast<int>(all.sum / all.seen);
    shift best;
    auto least = std::numeric_limits<std::int64_t>::max();
    std::int64_t sum = 0;
    std::int64_t shifts = 0;
    for (int dy = -most_shift; dy <= most_shift; ++dy) {
        for (int dx = -most_shift; dx <= most_shift; ++dx) {
            const auto difference = compare(reference, picture, size, {dx, dy}, brighter).absolute;
            sum += difference;
            ++shifts;
            if (difference < least) {
                least = difference;
                best = {dx, dy};
            }
        }
    }
    const bool is_clear = static_cast<double>(least * shifts) < clearly_less * static_cast<double>(sum);
    return is_clear ? std::optional{best} : std::nullopt;
}

void align(rectified& picture, extent size, shift by) {
    if (by != shift{}) {
        picture = {.pixels = moved(picture.pixels, size, by), .seen = moved(picture.seen, size, by)};
    }
}

} // namespace fmv
