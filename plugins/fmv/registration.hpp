// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "ground_grid.hpp"

#include <optional>

namespace fmv {

/// How far a picture is from the reference, because the camera pointed elsewhere than it reports, in whole pixels:
/// pixel (x, y) of the picture shows what the reference has at (x + dx, y + dy).
struct shift {
    int dx = 0;
    int dy = 0;

    bool operator==(const shift&) const = default;
};

/// A picture is off by this much at most, in each direction.
constexpr int most_shift = 4;

/// The shift for which picture and reference differ the least, by the sum of absolute differences over a grid of
/// pixels that the picture shows, apart from its brightness as a whole. Moving objects have little effect, because they
/// are small compared with the background. Nothing, if the picture shows less than a fifth of the ground, or if that
/// has nothing by which the shift can be told: because it is dark, covered, or another place.
std::optional<shift> register_with(const grey& reference, const rectified& picture, extent size);

/// Moves a picture by that shift. What moves in from outside has not been seen.
void align(rectified& picture, extent size, shift by);

} // namespace fmv
