// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "geo/camera.hpp"
#include "image.hpp"

namespace fmv {

/// A picture of the ground as from straight above, and which of its pixels the frame showed.
struct rectified {
    grey pixels;
    grey seen; ///< 0 where the frame did not show the ground
};

/// The ground in squares: a map that has the place, the direction and the resolution of a camera's first frame. Frames
/// that the camera takes later from elsewhere are mapped on it, so that what does not move stays where it is.
class ground_grid {
  public:
    /// \pre the middle of the frame shows the ground
    ground_grid(const geo::camera& first, extent size);

    /// The side of a square, in metres.
    [[nodiscard]] double cell() const noexcept { return cell_; }
    [[nodiscard]] geo::plane_position to_ground(point at) const noexcept;
    [[nodiscard]] point to_grid(geo::plane_position at) const noexcept;
    /// A movement, in metres instead of squares.
    [[nodiscard]] geo::plane_position movement(point by) const noexcept;
    /// Maps a frame on the grid, moved by `correction` squares.
    [[nodiscard]] rectified rectify(const grey& frame, const geo::camera& from, point correction) const;

  private:
    extent size_;
    double cell_ = 0;
    geo::plane_position middle_{};
    geo::plane_position right_{}, down_{}; ///< metres per square
};

} // namespace fmv
