// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace cles::runtime {

/// Decides what happens when the process of an isolated plugin has ended: it is restarted, or its tasks are withdrawn
/// because it ends too often.
class restart_policy {
  public:
    static constexpr std::size_t max_ends = 3;
    static constexpr std::chrono::seconds period{60};

    enum class decision : std::uint8_t { restart, withdraw };

    /// The process has ended, or could not be started. The last of `max_ends` within `period` withdraws the tasks.
    decision ended(time_point now) noexcept {
        ++count_;
        const bool often = recorded_ >= max_ends - 1 && now - ends_[next_] < period;
        ends_[next_] = now; // the oldest one
        next_ = (next_ + 1) % ends_.size();
        recorded_ += recorded_ < ends_.size() ? 1 : 0;
        withdrawn_ = withdrawn_ || often;
        return withdrawn_ ? decision::withdraw : decision::restart;
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
    /// How often it has ended so far.
    [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

  private:
    std::array<time_point, max_ends - 1> ends_{}; // the latest ones, as a ring
    std::size_t next_ = 0;
    std::size_t recorded_ = 0;
    std::uint64_t count_ = 0;
    bool withdrawn_ = false;
};

} // namespace cles::runtime
