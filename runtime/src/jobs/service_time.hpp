// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <boost/unordered/unordered_flat_map.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace cles::runtime {

/// How long a job holds a worker: a moving average in which each new value has a weight of one eighth, like TCP's
/// estimate of the round-trip time (RFC 6298, section 2).
class service_time {
  public:
    /// How long a value says something about the jobs to come. A node that runs none does not learn that they have
    /// become shorter, and others would not send it any.
    static constexpr std::chrono::milliseconds recent_for{1'000};

    void add(std::chrono::nanoseconds took, time_point now) noexcept {
        const auto ns = took.count() < 0 ? 0 : took.count();
        smoothed_ = known_ ? smoothed_ + (ns - smoothed_) / weight : ns;
        known_ = true;
        last_ = now;
    }
    /// Zero before the first job.
    [[nodiscard]] std::chrono::nanoseconds value() const noexcept { return std::chrono::nanoseconds{smoothed_}; }
    /// The same; zero also if no job has ended lately.
    [[nodiscard]] std::chrono::nanoseconds recent(time_point now) const noexcept {
        return now - last_ < recent_for ? value() : std::chrono::nanoseconds{0};
    }

  private:
    static constexpr std::int64_t weight = 8;

    std::int64_t smoothed_ = 0;
    bool known_ = false;
    time_point last_{}; // when a job ended
};

/// The same for each task.
class task_times {
  public:
    void add(const void* task, std::chrono::nanoseconds took, time_point now) {
        if (times_.size() >= most && !times_.contains(task)) {
            times_.clear(); // of tasks that are no longer registered, most likely
        }
        times_[task].add(took, now);
    }
    /// Zero before its first job.
    [[nodiscard]] std::chrono::nanoseconds of(const void* task) const noexcept {
        const auto found = times_.find(task);
        return found != times_.end() ? found->second.value() : std::chrono::nanoseconds{0};
    }

  private:
    static constexpr std::size_t most = 1024;

    boost::unordered_flat_map<const void*, service_time> times_;
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
