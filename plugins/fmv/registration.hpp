// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "image.hpp"

namespace fmv {

/// How far the camera has moved since the reference was taken, in whole pixels: pixel (x, y) of the picture shows what
/// the reference has at (x + dx, y + dy).
struct shift {
    int dx = 0;
    int dy = 0;

    bool operator==(const shift&) const = default;
};

/// The camera shakes by this much at most, in each direction.
constexpr int most_shift = 4;

/// The shift for which picture and reference differ the least, by the sum of absolute differences over a grid of
/// pixels. Moving objects have little effect, because they are small compared with the background.
shift register_with(const grey& reference, const grey& picture, extent size);

/// The picture as the camera would have taken it from where the reference was. Pixels outside the picture are taken
/// from the reference, so that they show no change.
void align(const grey& reference, grey& picture, extent size, shift by);

} // namespace fmv
