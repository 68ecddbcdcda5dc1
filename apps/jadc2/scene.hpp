// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "fmv/image.hpp"

#include <cstdint>
#include <vector>

namespace jadc2 {

/// The ground and the frames of the camera: identical for a seed on every machine. Ground with a texture,
/// some edges and vehicles that move, from a camera that shakes by fractions of pixels, with noise.
///
/// Places are pixels of the ground: pixel (x, y) of a frame shows the ground at (x, y) + `camera(frame)`.
class scene {
  public:
    static constexpr fmv::extent size{.width = 320, .height = 240};
    static constexpr double noise = 4; ///< standard deviation, in grey levels

    explicit scene(std::uint64_t seed);

    [[nodiscard]] fmv::grey frame(std::uint64_t number) const;
    [[nodiscard]] fmv::point camera(std::uint64_t number) const;
    /// Where the vehicles are; time is counted in frames. It is only for scoring.
    [[nodiscard]] std::vector<fmv::point> truth(double time) const;

  private:
    struct vehicle {
        fmv::point start{}, velocity{}; ///< pixels per frame
        double half_length = 0, half_width = 0;
        double contrast = 0; ///< grey levels
    };

    void make_ground();
    void make_vehicles();
    void draw(const vehicle& v, fmv::point at, std::vector<float>& onto) const;

    std::uint64_t seed_;
    std::vector<float> ground_; ///< with a margin on all sides
    std::vector<vehicle> vehicles_;
    std::vector<float> normal_; ///< a table of normally distributed numbers
};

} // namespace jadc2
