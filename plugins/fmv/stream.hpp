// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "background.hpp"
#include "detector.hpp"
#include "registration.hpp"
#include "tracker.hpp"

namespace fmv {

/// One camera's video, frame by frame: aligned with the first frame and compared with the background; targets are
/// tracked over time.
class stream {
  public:
    explicit stream(extent size) : size_(size), still_(size), detector_(size) {}

    [[nodiscard]] extent size() const noexcept { return size_; }
    /// The next frame, `frames` after the last one received. Targets are reported in the coordinates of the first
    /// frame.
    void take(grey frame, int frames = 1);
    /// Whether the background is known; until then nothing is detected.
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
