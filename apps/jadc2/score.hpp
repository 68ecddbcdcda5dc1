// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "fmv/image.hpp"

#include <cstdint>
#include <vector>

namespace jadc2 {

/// How well tracks match the truth.
class score {
  public:
    /// The maximum distance of a track from its vehicle, in pixels.
    static constexpr double near = 6;

    struct totals {
        std::uint64_t frames = 0;
        std::uint64_t vehicles = 0; ///< of all frames
        std::uint64_t found = 0;    ///< of these
        std::uint64_t false_tracks = 0;
    };

    /// Adds one frame. Each vehicle has one track at most, the nearest ones first; all others are false.
    void add(const std::vector<fmv::point>& truth, const std::vector<fmv::point>& tracks);

    [[nodiscard]] const totals& sums() const noexcept { return sums_; }
    [[nodiscard]] double recall() const noexcept;
    [[nodiscard]] double false_per_frame() const noexcept;

  private:
    totals sums_;
};

} // namespace jadc2
