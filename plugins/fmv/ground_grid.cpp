// SPDX-License-Identifier: BSL-1.0
#include "ground_grid.hpp"

#include <cmath>

namespace fmv {

ground_grid::ground_grid(const geo::camera& first, extent size) : size_(size) {
    const geo::projection view{first};
    cell_ = view.slant_range() / first.focal_length;
    middle_ = view.to_ground({.x = first.centre_x, .y = first.centre_y}).value_or(first.at);
    right_ = {.east = cell_ * std::cos(first.azimuth), .north = -cell_ * std::sin(first.azimuth)};
    down_ = {.east = -cell_ * std::sin(first.azimuth), .north = -cell_ * std::cos(first.azimuth)};
}

geo::plane_position ground_grid::movement(point by) const noexcept {
    return {.east = right_.east * by.x + down_.east * by.y, .north = right_.north * by.x + down_.north * by.y};
}

geo::plane_position ground_grid::to_ground(point at) const noexcept {
    const auto from_middle = movement({.x = at.x - size_.width / 2.0, .y = at.y - size_.height / 2.0});
    return {.east = middle_.east + from_middle.east, .north = middle_.north + from_middle.north};
}

point ground_grid::to_grid(geo::plane_position at) const noexcept {
    const double east = (at.east - middle_.east) / (cell_ * cell_);
    const double north = (at.north - middle_.north) / (cell_ * cell_);
    return {.x = size_.width / 2.0 + right_.east * east + right_.north * north,
            .y = size_.height / 2.0 + down_.east * east + down_.north * north};
}

rectified ground_grid::rectify(const grey& frame, const geo::camera& from, point correction) const {
    const geo::projection view{from};
    rectified out{.pixels = grey(size_.pixels()), .seen = grey(size_.pixels())};
    const auto seen_at = [&](double x, double y) {
        return view.seen(to_ground({.x = x - correction.x, .y = y - correction.y}));
    };
    // Of a row, two squares tell all others: what the camera sees is linear in the place.
    for (int y = 0; y < size_.height; ++y) {
        const auto first = seen_at(0, y);
        const auto next = seen_at(1, y);
        const geo::projection::view step{
            .depth = next.depth - first.depth, .right = next.right - first.right, .down = next.down - first.down};
        for (int x = 0; x < size_.width; ++x) {
            const auto at = view.in_image({.depth = first.depth + x * step.depth,
                                           .right = first.right + x * step.right,
                                           .down = first.down + x * step.down});
            if (!at || !(at->x >= 0 && at->y >= 0 && at->x < size_.width - 1 && at->y < size_.height - 1)) {
                continue;
            }
            const int left = static_cast<int>(at->x);
            const int top = static_cast<int>(at->y);
            const auto u = static_cast<float>(at->x - left);
            const auto v = static_cast<float>(at->y - top);
            const float brightness = between_pixels(frame, size_, size_.at(left, top), u, v);
            const auto to = size_.at(x, y);
            // NOLINTNEXTLINE(bugprone-incorrect-roundings): never negative, and a call for each pixel would cost more
            out.pixels[to] = static_cast<std::uint8_t>(brightness + 0.5F);
            out.seen[to] = 1;
        }
    }
    return out;
}

} // namespace fmv
