// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "fmv/image.hpp"

#include <cstdint>
#include <optional>
#include <vector>

namespace jadc2 {

/// A vehicle as the camera sees it.
struct visible_vehicle {
    fmv::point at{};
    bool has_to_be_found = false; ///< it has been in sight for long enough
};

/// How well tracks match the truth, in pixels.
class score {
  public:
    /// The maximum distance of a track from its vehicle.
    static constexpr double near = 6;

    struct totals {
        std::uint64_t frames = 0;
        std::uint64_t vehicles = 0; ///< of all frames, that have to be found
        std::uint64_t found = 0;    ///< of these
        std::uint64_t false_tracks = 0;
    };

    /// Adds one frame. Each vehicle has one track at most, the nearest ones first; all others are false.
    /// \return the vehicle of each track
    std::vector<std::optional<std::size_t>> add(const std::vector<visible_vehicle>& truth,
                                                const std::vector<fmv::point>& tracks);

    [[nodiscard]] const totals& sums() const noexcept { return sums_; }
    [[nodiscard]] double recall() const noexcept;
    [[nodiscard]] double false_per_frame() const noexcept;

  private:
    totals sums_;
};

} // namespace jadc2
