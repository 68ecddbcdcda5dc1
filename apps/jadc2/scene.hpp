// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "fmv/messages.hpp"
#include "fmv/stream.hpp"
#include "geo/traffic.hpp"

#include <cstdint>
#include <vector>

namespace jadc2 {

/// The ground, and what the camera of a circling aircraft shows of it: determined by a seed and the time. Ground with a
/// texture, some edges, and vehicles; from a camera that shakes, with noise.
///
/// Positions are in metres from `geo::traffic::origin`, at which the camera points.
class scene {
  public:
    static constexpr fmv::extent size{.width = 320, .height = 240};
    static constexpr double noise = 4;             ///< standard deviation, in grey levels
    static constexpr double position_sigma = 1.5;  ///< m, of the aircraft's navigation, constant during a flight
    static constexpr double pointing_sigma = 0.07; ///< degrees, of the camera's mount, constant during a flight

    explicit scene(std::uint64_t seed);

    /// \param number of the frame, which determines noise and shaking \param utc s since 1970
    [[nodiscard]] fmv::grey frame(std::uint64_t number, double utc) const;
    /// Where the camera is and points in truth.
    [[nodiscard]] geo::camera camera(std::uint64_t number, double utc) const;
    /// What the aircraft knows of it.
    [[nodiscard]] fmv::camera_message reported(double utc) const;
    /// Where the vehicles are. It is only for scoring.
    [[nodiscard]] std::vector<geo::traffic::motion> truth(double utc) const { return traffic_.at(utc); }

    /// On which its positions are.
    static const geo::tangent_plane& plane();

  private:
    [[nodiscard]] geo::camera nominal(double utc) const;
    void make_ground();
    void draw(std::size_t vehicle, geo::plane_position at, const geo::projection& view, std::vector<float>& onto) const;

    std::uint64_t seed_;
    geo::traffic traffic_;
    std::vector<float> ground_;                       ///< grey levels of squares
    std::vector<float> normal_;                       ///< a table of normally distributed numbers
    double phase_ = 0;                                ///< of the circle that the aircraft flies, rad
    double error_east_ = 0, error_north_ = 0;         ///< of the reported position, m
    double error_azimuth_ = 0, error_depression_ = 0; ///< of the reported pointing, rad
};

} // namespace jadc2
