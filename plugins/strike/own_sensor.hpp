// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "geo/tangent_plane.hpp"
#include "geo/traffic.hpp"
#include "target_filter.hpp"

#include <cstdint>
#include <vector>

namespace strike {

/// Where the sensor saw something; it may be nothing.
struct plot {
    geo::plane_position at{};
    covariance noise{};
};

/// What the sensor saw at one time. Positions are on the sensor's plane.
struct scan {
    double utc = 0;
    std::vector<plot> plots;
};

/// The strike aircraft's own sensor: a simulated radar that sees moving vehicles of the same traffic as the
/// reconnaissance aircraft's camera, in range and azimuth, with noise; some are missed, and some plots are false. What
/// it sees is determined by the seed of the traffic and the time, as if it had always been on.
class own_sensor {
  public:
    static constexpr double interval = 0.1; ///< s, from scan to scan

    /// \param from where the aircraft is
    own_sensor(std::uint64_t seed, geo::geographic from);

    /// The last scans before that time, oldest first. They are kept for the next call.
    const std::vector<scan>& last(std::uint64_t count, double utc);
    /// The plane on which its plots are; its origin is the aircraft.
    [[nodiscard]] const geo::tangent_plane& plane() const noexcept { return plane_; }

  private:
    [[nodiscard]] scan scan_at(std::int64_t number) const;

    std::uint64_t seed_;
    geo::traffic traffic_;
    geo::tangent_plane plane_;
    geo::plane_position middle_{}; ///< of the traffic
    std::vector<scan> kept_;
    std::int64_t newest_ = 0; ///< number of the last one of them
};

} // namespace strike
