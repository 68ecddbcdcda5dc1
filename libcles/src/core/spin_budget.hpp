// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>

namespace cles::core {

/// Decides how long a thread without work looks for more before it sleeps: as long as allowed while that finds
/// something, and hardly ever while it does not.
class spin_budget {
  public:
    using duration = std::chrono::nanoseconds;

    explicit spin_budget(duration bound) noexcept : bound_(bound) {}

    /// For how long to look now; zero: sleep at once.
    duration next() noexcept {
        if (skip_ != 0) {
            --skip_;
            return duration::zero();
        }
        return bound_;
    }
    /// Looking has found work.
    void found() noexcept { misses_ = 0; }
    /// Looking has found nothing, or only what came because the thread was made to leave its core.
    void missed() noexcept {
        if (misses_ < patience + longest_pause) {
            ++misses_;
        }
        skip_ = misses_ <= patience ? 0 : 1U << (misses_ - patience);
    }

  private:
    static constexpr std::uint32_t patience = 3;       // misses in a row that are put up with
    static constexpr std::uint32_t longest_pause = 12; // as a power of two, in waits

    duration bound_;
    std::uint32_t misses_ = 0;
    std::uint32_t skip_ = 0;
};

} // namespace cles::core
