// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace cles::runtime {

/// Decides what happens when the process of an isolated plugin has ended: it is restarted, at once or later, or its
/// tasks are withdrawn because it ends too often.
class restart_policy {
  public:
    static constexpr std::size_t max_ends = 3;
    static constexpr std::chrono::seconds period{60};
    static constexpr std::chrono::milliseconds min_delay{100};
    static constexpr std::chrono::milliseconds max_delay{5'000};

    enum class decision : std::uint8_t { restart, withdraw };

    /// The process has ended. The last of `max_ends` within `period` withdraws the tasks.
    decision ended(time_point now) noexcept {
        const bool often = recorded_ >= max_ends - 1 && now - ends_[next_] < period;
        ends_[next_] = now; // the oldest one
        next_ = (next_ + 1) % ends_.size();
        recorded_ += recorded_ < ends_.size() ? 1 : 0;
        withdrawn_ = withdrawn_ || often;
        return withdrawn_ ? decision::withdraw : decision::restart;
    }
    /// The process could not be started. That does not withdraw the tasks. Returns how long to wait before the next
    /// start: twice as long each time, unless the last time is longer ago than `period`.
    std::chrono::milliseconds delay(time_point now) noexcept {
        const bool recent = delayed_ > 0 && now - last_delayed_ < period;
        const auto wanted = min_delay * (1U << (recent ? std::min(delayed_, 10U) : 0U));
        delayed_ = recent ? delayed_ + 1 : 1;
        last_delayed_ = now;
        return std::min<std::chrono::milliseconds>(wanted, max_delay);
    }
    /// Forgets the past: the tasks are to be offered again. Returns whether they had been withdrawn.
    bool reset() noexcept {
        const bool was = withdrawn_;
        withdrawn_ = false;
        recorded_ = 0;
        next_ = 0;
        return was;
    }

    [[nodiscard]] bool withdrawn() const noexcept { return withdrawn_; }

  private:
    std::array<time_point, max_ends - 1> ends_{}; // the latest ones, as a ring
    std::size_t next_ = 0;
    std::size_t recorded_ = 0;
    unsigned delayed_ = 0;
    time_point last_delayed_{};
    bool withdrawn_ = false;
};

} // namespace cles::runtime
