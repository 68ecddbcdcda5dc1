// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "tangent_plane.hpp"

#include <cstdint>
#include <vector>

namespace geo {

/// Simulated vehicles on parallel roads, which all simulated sensors see: determined by a seed and the time, so that
/// programs on several hosts agree on them without a message. A vehicle keeps its road, and its speed varies slightly.
///
/// At the end of its road, far outside what a camera sees, it starts again at the other end.
class traffic {
  public:
    /// The middle of the area, and the origin of all positions below.
    static constexpr geographic origin{.lat = 33.2, .lon = -106.4};
    static constexpr double half_road = 200; ///< m, from the middle to the end of a road

    struct vehicle {
        double half_length = 0, half_width = 0; ///< m
        double contrast = 0;                    ///< grey levels, to the ground
    };
    struct motion {
        plane_position at{};
        plane_position velocity{}; ///< m/s
    };

    explicit traffic(std::uint64_t seed);

    [[nodiscard]] const std::vector<vehicle>& vehicles() const noexcept { return vehicles_; }
    /// Of each vehicle. \param utc s since 1970
    [[nodiscard]] std::vector<motion> at(double utc) const;
    /// The direction of the roads: east and north, of length 1.
    [[nodiscard]] plane_position along() const noexcept { return along_; }

  private:
    struct course {
        double start = 0, speed = 0; ///< m along the road, m/s
        double phase = 0;            ///< rad, of the variation of its speed
        double aside = 0;            ///< m from the middle
    };

    plane_position along_;
    std::vector<vehicle> vehicles_;
    std::vector<course> courses_;
};

} // namespace geo
