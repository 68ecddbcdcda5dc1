// SPDX-License-Identifier: BSL-1.0
#include "tangent_plane.hpp"

#include <cmath>
#include <numbers>

namespace geo {
namespace {

constexpr double semi_major = 6378137;           // m, WGS 84
constexpr double flattening = 1 / 298.257223563; // WGS 84
constexpr double squared_eccentricity = flattening * (2 - flattening);
constexpr double degree = std::numbers::pi / 180;

struct metres_per_degree {
    double north, east;
};

metres_per_degree at_latitude(double lat) {
    const double sine = std::sin(lat * degree);
    const double rest = 1 - squared_eccentricity * sine * sine;
    const double prime_vertical = semi_major / std::sqrt(rest);
    return {.north = degree * prime_vertical * (1 - squared_eccentricity) / rest,
            .east = degree * prime_vertical * std::cos(lat * degree)};
}

} // namespace

plane_position tangent_plane::to_plane(const geographic& at) const {
    const auto scale = at_latitude((origin_.lat + at.lat) / 2);
    return {.east = (at.lon - origin_.lon) * scale.east, .north = (at.lat - origin_.lat) * scale.north};
}

geographic tangent_plane::to_geographic(const plane_position& at) const {
    auto scale = at_latitude(origin_.lat);
    for (int i = 0; i < 3; ++i) { // each makes the error of the latitude some 10,000 times smaller
        scale = at_latitude(origin_.lat + at.north / scale.north / 2);
    }
    return {.lat = origin_.lat + at.north / scale.north, .lon = origin_.lon + at.east / scale.east};
}

} // namespace geo
