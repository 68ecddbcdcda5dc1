// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace cles::runtime {

/// How long a job holds a worker: a moving average in which each new value has a weight of one eighth, like TCP's
/// estimate of the round-trip time (RFC 6298, section 2).
class service_time {
  public:
    void add(std::chrono::nanoseconds took) noexcept {
        const auto ns = took.count() < 0 ? 0 : took.count();
        smoothed_ = known_ ? smoothed_ + (ns - smoothed_) / weight : ns;
        known_ = true;
    }
    /// Zero before the first job.
    [[nodiscard]] std::chrono::nanoseconds value() const noexcept { return std::chrono::nanoseconds{smoothed_}; }

  private:
    static constexpr std::int64_t weight = 8;

    std::int64_t smoothed_ = 0;
    bool known_ = false;
};

inline constexpr std::chrono::milliseconds min_retry{10};
inline constexpr std::chrono::milliseconds max_retry{10'000};

/// When to retry a refused request (`retry_ms` of `busy`): after the workers have processed half of the queue, so that
/// retries find capacity, but do not all arrive at an empty queue.
inline std::chrono::milliseconds retry_delay(std::size_t queued, std::size_t workers,
                                             std::chrono::nanoseconds service_time) noexcept {
    using wide = std::chrono::duration<double, std::milli>;
    const auto each = wide{service_time} / static_cast<double>(std::max<std::size_t>(workers, 1));
    const auto half = each * (static_cast<double>(queued) / 2);
    return std::chrono::ceil<std::chrono::milliseconds>(std::clamp<wide>(half, wide{min_retry}, wide{max_retry}));
}

} // namespace cles::runtime
