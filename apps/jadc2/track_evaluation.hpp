// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "scene.hpp"
#include "score.hpp"

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

namespace jadc2 {

/// Compares the tracks of a stream with the truth of its scene: whether vehicles are found, in pixels of the stream's
/// first frame, where the constant error of the reported camera cancels, as it was before a correction; and how far
/// they are from their places, in metres.
class track_evaluation {
  public:
    explicit track_evaluation(const scene& of) : scene_(of), in_sight_(of.truth(0).size()) {}

    /// A stream begins with this frame.
    void begin(std::uint64_t number, double utc);
    /// The tracks after a frame of it. \param ready whether its background is known
    /// \param corrected_by what the camera's places were corrected by
    void add(double utc, const std::vector<fmv::track>& tracks, bool ready, const fmv::place_shift& corrected_by = {});

    [[nodiscard]] const score& found() const noexcept { return score_; }
    /// The vehicle that a track of this stream followed last; nothing, if it followed none.
    [[nodiscard]] std::optional<std::size_t> vehicle_of(std::uint64_t track) const;
    /// The error of the places and velocities of tracks, per axis: root mean squares.
    [[nodiscard]] double place_error() const noexcept;    ///< m
    [[nodiscard]] double velocity_error() const noexcept; ///< m/s

  private:
    const scene& scene_;
    score score_;
    std::optional<geo::projection> true_view_, reported_view_; ///< of the first frame
    std::optional<fmv::ground_grid> map_;                      ///< the part of the ground that the node maps
    std::vector<int> in_sight_;                                ///< of each vehicle: frames, one after another
    std::map<std::uint64_t, std::size_t> vehicles_;
    double place_squares_ = 0, velocity_squares_ = 0;
    std::uint64_t compared_ = 0;
};

} // namespace jadc2
