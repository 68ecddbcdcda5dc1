// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>

namespace cles::core {

/// Decides how long a thread without work polls for more before it sleeps: as long as allowed while polling finds work,
/// and rarely otherwise.
class spin_budget {
  public:
    using duration = std::chrono::nanoseconds;

    explicit spin_budget(duration bound) noexcept : bound_(bound) {}

    /// How long to poll now; zero: sleep at once.
    duration next() noexcept {
        if (skip_ != 0) {
            --skip_;
            return duration::zero();
        }
        return bound_;
    }
    /// Polling has found work.
    void found() noexcept { misses_ = 0; }
    /// Polling has found nothing, or only what arrived because the thread was preempted.
    void missed() noexcept {
        if (misses_ < patience + max_pause) {
            ++misses_;
        }
        skip_ = misses_ <= patience ? 0 : 1U << (misses_ - patience);
    }

  private:
    static constexpr std::uint32_t patience = 3;   // consecutive misses that are tolerated
    static constexpr std::uint32_t max_pause = 12; // as a power of two, in waits

    duration bound_;
    std::uint32_t misses_ = 0;
    std::uint32_t skip_ = 0;
};

} // namespace cles::core
