// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "geo/tangent_plane.hpp"
#include "geo/traffic.hpp"

#include <cstdint>
#include <optional>
#include <vector>

namespace fmv {

/// Where the radar saw something that moves, at one time; it may be nothing.
struct radar_scan {
    double utc = 0;
    std::vector<geo::plane_position> plots; ///< m from the middle of the traffic
};

/// The satellite's own sensor: a simulated radar that sees moving vehicles of the same traffic as the camera. Its plots
/// are less accurate than what a picture shows, but have no error in common; some vehicles are missed, and some plots
/// are false. What it sees is determined by the seed of the traffic and the time, as if it had always been on.
class ground_radar {
  public:
    static constexpr double interval = 1;   ///< s, from scan to scan
    static constexpr double deviation = 4;  ///< m, standard deviation of a plot, per axis
    static constexpr double detected = 0.9; ///< the share of vehicles in a scan

    explicit ground_radar(std::uint64_t seed) : seed_(seed), traffic_(seed) {}

    /// The newest scan after a time, and until another one; nothing, if there is none.
    [[nodiscard]] std::optional<radar_scan> newest(double after, double until) const;
    /// The plane on which its plots are.
    static const geo::tangent_plane& plane();

  private:
    [[nodiscard]] radar_scan scan_at(std::int64_t number) const;

    std::uint64_t seed_;
    geo::traffic traffic_;
};

} // namespace fmv
