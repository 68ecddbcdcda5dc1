// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <optional>

namespace fmv {

/// Which frames of a video have come, from the first one on. Some may be missing, and none counts twice.
class frame_account {
  public:
    /// A frame has come. False if it, or a later one, has come before.
    bool take(std::uint64_t number) noexcept {
        if (last_ && number <= *last_) {
            return false;
        }
        missing_ += last_ ? number - *last_ - 1 : 0;
        last_ = number;
        return true;
    }
    /// Frames between the first and the last one that have not come.
    [[nodiscard]] std::uint64_t missing() const noexcept { return missing_; }

  private:
    std::optional<std::uint64_t> last_; ///< nothing until the first one
    std::uint64_t missing_ = 0;
};

} // namespace fmv
