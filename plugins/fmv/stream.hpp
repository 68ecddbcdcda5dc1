// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "background.hpp"
#include "detector.hpp"
#include "registration.hpp"
#include "tracker.hpp"

namespace fmv {

/// One camera's video, frame by frame: aligned with the first, compared with what stands still, and followed over time.
class stream {
  public:
    explicit stream(extent size) : size_(size), still_(size), detector_(size) {}

    [[nodiscard]] extent size() const noexcept { return size_; }
    /// The next frame, so many after the last that came. What is found is told where the first frame would have shown
    /// it.
    void take(grey frame, int frames = 1);
    /// Whether it knows what stands still, before which nothing is detected.
    [[nodiscard]] bool ready() const noexcept { return still_.known(); }
    [[nodiscard]] std::vector<tracked> targets() const { return tracker_.confirmed(); }

  private:
    extent size_;
    background still_;
    detector detector_;
    tracker tracker_;
    bool begun_ = false;
};

} // namespace fmv
