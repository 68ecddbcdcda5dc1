// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "background.hpp"
#include "detector.hpp"
#include "ground_grid.hpp"
#include "messages.hpp"
#include "registration.hpp"
#include "tracker.hpp"

#include <cstdint>
#include <optional>

namespace fmv {

/// The camera on a plane, whose origin is below it.
geo::camera to_camera(const camera_message& what, extent size, const geo::tangent_plane& plane);

/// One camera's video, frame by frame: mapped on the ground, aligned with the first frame and compared with the
/// background; targets are tracked over time.
///
/// What the camera reports wrongly about its position and direction moves all places alike: alignment makes the error
/// of the first frame that of all, so it remains the same.
///
/// A frame that cannot be aligned, such as one of a cloud, shows nothing: targets move on as predicted, and are given
/// up soon. After many such frames, and while the background is not known, the stream begins anew.
class stream {
  public:
    explicit stream(extent size) : size_(size), still_(size), detector_(size) {}

    [[nodiscard]] extent size() const noexcept { return size_; }
    /// When the last frame was taken.
    [[nodiscard]] std::optional<double> utc() const noexcept { return utc_; }
    /// The next frame. \pre it was taken later than the last one, and the middle of it shows the ground
    void take(const grey& frame, const camera_message& from, double utc);
    /// Whether the background is known; until then nothing is detected.
    [[nodiscard]] bool ready() const noexcept { return still_.known(); }
    /// The confirmed targets on the ground, at the time of the last frame.
    [[nodiscard]] std::vector<track> tracks() const;
    /// How wrong their places are: standard deviations, per axis, m.
    struct place_error {
        std::uint64_t map = 0; ///< counts the maps: each has an error of its own that all its places have in common
        double common = 0;     ///< of that error
        double own = 0;        ///< of the rest
    };
    /// Nothing before the first frame.
    [[nodiscard]] std::optional<place_error> error_of_places() const;

  private:
    struct map {
        geo::tangent_plane plane;
        ground_grid grid;
        double deviation = 0; ///< of a place, m
    };

    void begin(const camera_message& first);
    std::optional<rectified> aligned(const grey& frame, const camera_message& from);
    void watch(rectified picture);

    extent size_;
    std::optional<map> map_;
    std::uint64_t maps_ = 0; ///< that were begun
    std::optional<double> utc_;
    double interval_ = 0; ///< between the last two frames, s
    double period_ = 0;   ///< the same, smoothed
    int unaligned_ = 0;   ///< frames since the last one that could be aligned
    point correction_{};  ///< of what the camera reports now, in squares
    background still_;
    detector detector_;
    tracker tracker_;
};

} // namespace fmv
