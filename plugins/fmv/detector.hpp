// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "image.hpp"

#include <vector>

namespace fmv {

/// A connected area that differs from the background.
struct detection {
    point centre{}; ///< weighted by how much each pixel differs
    int area = 0;   ///< pixels
};

/// What a frame has that the background has not.
class detector {
  public:
    explicit detector(extent size);

    /// \param aligned with the background
    const std::vector<detection>& look(const grey& aligned, const std::vector<float>& background);
    /// Where something was detected, and a margin about it: not 0.
    [[nodiscard]] const grey& moving() const noexcept { return moving_; }
    /// The standard deviation of the smoothed difference where nothing moves, as it was estimated.
    [[nodiscard]] double noise() const noexcept { return noise_; }

  private:
    void differ(const grey& aligned, const std::vector<float>& background);
    void estimate_noise();
    void mark(const std::vector<float>& background);
    void gather();
    detection fill(int x, int y);

    extent size_;
    std::vector<float> difference_; ///< smoothed
    std::vector<float> rows_;       ///< smoothed along the rows alone
    grey mask_;                     ///< 1 where the difference is large, 2 where it has been counted
    grey moving_;
    std::vector<detection> found_;
    std::vector<std::size_t> open_; ///< of the area that is being filled
    double noise_ = 0;
};

} // namespace fmv
