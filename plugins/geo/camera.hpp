// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "tangent_plane.hpp"

#include <optional>

namespace geo {

/// A pinhole camera above flat ground, without distortion and without roll: the rows of its picture are level.
struct camera {
    plane_position at{};
    double height = 0;                 ///< m above the ground
    double azimuth = 0;                ///< rad, of its optical axis, clockwise from north
    double depression = 0;             ///< rad, of its optical axis, below the horizon
    double focal_length = 0;           ///< pixels
    double centre_x = 0, centre_y = 0; ///< the pixel on the optical axis
};

/// A place in a picture, in pixels; y increases downwards.
struct image_position {
    double x = 0, y = 0;
};

/// Which place on the ground a pixel shows, and the reverse.
class projection {
  public:
    explicit projection(const camera& from);

    /// Nothing, for pixels above the horizon.
    [[nodiscard]] std::optional<plane_position> to_ground(image_position at) const noexcept {
        const double across = at.x - from_.centre_x;
        const double down = at.y - from_.centre_y;
        const double descent = axis_.down * from_.focal_length + rows_.down * down;
        if (!(descent > 0)) {
            return std::nullopt;
        }
        const double scale = from_.height / descent;
        return plane_position{.east = from_.at.east + scale * (axis_.east * from_.focal_length +
                                                               columns_.east * across + rows_.east * down),
                              .north = from_.at.north + scale * (axis_.north * from_.focal_length +
                                                                 columns_.north * across + rows_.north * down)};
    }
    /// Where a place is, seen from the camera, in metres: along the optical axis, and to the right and down in the
    /// picture. It is linear in the place.
    struct view {
        double depth = 0, right = 0, down = 0;
    };
    [[nodiscard]] view seen(plane_position at) const noexcept {
        const double east = at.east - from_.at.east;
        const double north = at.north - from_.at.north;
        return {.depth = axis_.east * east + axis_.north * north + axis_.down * from_.height,
                .right = columns_.east * east + columns_.north * north,
                .down = rows_.east * east + rows_.north * north + rows_.down * from_.height};
    }
    /// Nothing, for places behind the camera. The result may be outside the picture.
    [[nodiscard]] std::optional<image_position> in_image(const view& what) const noexcept {
        if (!(what.depth > 0)) {
            return std::nullopt;
        }
        const double scale = from_.focal_length / what.depth;
        return image_position{.x = from_.centre_x + scale * what.right, .y = from_.centre_y + scale * what.down};
    }
    [[nodiscard]] std::optional<image_position> to_image(plane_position at) const noexcept {
        return in_image(seen(at));
    }
    /// From the camera to the ground along its optical axis, in metres.
    [[nodiscard]] double slant_range() const noexcept { return from_.height / axis_.down; }

  private:
    struct direction {
        double east = 0, north = 0, down = 0;
    };

    camera from_;
    direction axis_, columns_, rows_; ///< the optical axis, and along which x and y of the picture increase
};

/// The standard deviation of a place on the ground that such a camera shows in its centre: per axis, the mean of both.
/// \param position of the camera, m \param pointing of its optical axis in each of two directions, rad
double ground_deviation(const camera& from, double position, double pointing);

} // namespace geo
