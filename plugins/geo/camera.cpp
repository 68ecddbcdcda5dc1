// SPDX-License-Identifier: BSL-1.0
#include "camera.hpp"

#include <cmath>

namespace geo {

projection::projection(const camera& from)
    : from_(from), axis_{.east = std::cos(from.depression) * std::sin(from.azimuth),
                         .north = std::cos(from.depression) * std::cos(from.azimuth),
                         .down = std::sin(from.depression)},
      columns_{.east = std::cos(from.azimuth), .north = -std::sin(from.azimuth), .down = 0},
      rows_{.east = -std::sin(from.depression) * std::sin(from.azimuth),
            .north = -std::sin(from.depression) * std::cos(from.azimuth),
            .down = std::cos(from.depression)} {}

// An error of the pointing moves the place across the line of sight by the angle times the range, and along it by more,
// because the ground is seen at an angle.
double ground_deviation(const camera& from, double position, double pointing) {
    const double across = projection{from}.slant_range() * pointing;
    const double along = across / std::sin(from.depression);
    return std::sqrt(position * position + (across * across + along * along) / 2);
}

} // namespace geo
