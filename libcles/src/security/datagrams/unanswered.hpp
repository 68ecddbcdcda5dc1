// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>

namespace cles::security {

/// When something that is not answered is sent again: after 200 ms, then at doubling intervals, three times in all.
class unanswered {
  public:
    void start(time_point now) noexcept {
        sent_ = 1;
        due_ = now + first;
    }
    void stop() noexcept { sent_ = 0; }
    /// When to call `expire`.
    [[nodiscard]] time_point due() const noexcept { return sent_ == 0 ? time_point::max() : due_; }
    /// \pre it is due \return whether to send again; false: give up, and it has stopped
    [[nodiscard]] bool expire(time_point now) noexcept {
        if (sent_ == most) {
            stop();
            return false;
        }
        due_ = now + first * (1 << sent_);
        ++sent_;
        return true;
    }

  private:
    static constexpr int most = 3;
    static constexpr std::chrono::milliseconds first{200};

    int sent_ = 0;
    time_point due_{};
};

} // namespace cles::security
