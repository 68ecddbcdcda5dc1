// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace geo {

/// A position on the ellipsoid WGS 84, in degrees.
struct geographic {
    double lat = 0, lon = 0;
};

/// The same in metres east and north of an origin.
struct plane_position {
    double east = 0, north = 0;
};

/// The plane that touches the earth at an origin. Both directions use the radii of curvature at the latitude halfway to
/// the origin, so that they are exact inverses of each other, and distances between neighbours 10 km away from the
/// origin are wrong by at most 0.1 % up to 50 degrees of latitude.
class tangent_plane {
  public:
    explicit tangent_plane(geographic origin) : origin_(origin) {}

    [[nodiscard]] plane_position to_plane(const geographic& at) const;
    [[nodiscard]] geographic to_geographic(const plane_position& at) const;

  private:
    geographic origin_;
};

} // namespace geo
