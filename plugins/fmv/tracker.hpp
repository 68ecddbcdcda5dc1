// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "detector.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace fmv {

/// A target, followed over several frames.
struct tracked {
    std::uint64_t id = 0; ///< the same as long as it is followed
    point at{};
    point velocity{};     ///< pixels per second
    point first{};        ///< where it was first seen
    unsigned history = 1; ///< a bit for each look since, the lowest being the latest: 1 where it was seen
    double age = 0;       ///< s
    int looks = 0;        ///< since it was first seen
    int missed = 0;       ///< looks since it was last seen
    bool confirmed = false;
};

/// Puts detections of consecutive frames together. Each track has a predictor of constant velocity (an alpha-beta
/// filter); a detection belongs to the nearest one within a gate. One that has been seen in M of N frames, and has
/// moved, is confirmed; noise does the first seldom, and what a false background shows does not do the second.
class tracker {
  public:
    static constexpr double place_deviation = 0.4; ///< pixels, of a detection, per axis: standard deviation

    /// The detections of the frame that was taken so many seconds after the last one. \pre more than 0
    void step(std::span<const detection> seen, double seconds);
    /// Gives all targets up. Numbers are not used again.
    void forget() noexcept { all_.clear(); }
    /// Those that are confirmed.
    [[nodiscard]] std::vector<tracked> confirmed() const;
    /// The standard deviation of a velocity, per axis, after many frames that are so many seconds apart: pixels per
    /// second.
    static double velocity_deviation(double seconds);

  private:
    void predict(double seconds);
    void associate(std::span<const detection> seen, double seconds);
    void judge();

    std::vector<tracked> all_;
    std::vector<std::uint8_t> taken_; ///< of the detections
    std::uint64_t next_id_ = 1;
};

} // namespace fmv
