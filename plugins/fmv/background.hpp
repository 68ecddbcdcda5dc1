// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "image.hpp"

#include <vector>

namespace fmv {

/// The background. At first it is the median of some frames that are not adjacent, because a moving object covers each
/// pixel in only a few of them. Then it adapts slowly to changes of light, and more slowly where something has been
/// detected.
class background {
  public:
    static constexpr int samples = 9; ///< of the median
    static constexpr int apart = 3;   ///< frames from one to the next
    /// Frames until it is known.
    static constexpr int learning = (samples - 1) * apart + 1;

    explicit background(extent size);

    /// The first frame, with which the others are to be aligned until the background is known.
    [[nodiscard]] const grey& reference() const noexcept { return reference_; }
    [[nodiscard]] bool known() const noexcept { return seen_ >= learning; }
    /// Completes a frame with the background where it did not show the ground, so that nothing differs there. What it
    /// shows for the first time is background at first.
    void complete(grey& aligned, const grey& seen);
    /// A frame to learn from, aligned. \pre not known
    void learn(const grey& aligned);
    /// Follows an aligned frame; `moving` is not 0 where something has been detected. \pre known
    void follow(const grey& aligned, const grey& moving);
    /// Of each pixel.
    [[nodiscard]] const std::vector<float>& values() const noexcept { return values_; }

  private:
    void take_medians();

    extent size_;
    int seen_ = 0;
    grey reference_;
    grey shown_; ///< not 0 where a frame has shown the ground
    std::vector<grey> kept_;
    std::vector<float> values_;
};

} // namespace fmv
