// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "jobs/adaptive_mutex.hpp"

#include <chrono>
#include <cstdint>
#include <mutex>
#include <utility>

namespace cles::runtime {

/// How long a traced job has waited for a worker, and held one. May be used from any thread.
class job_times {
  public:
    /// What the job does from a point in time on.
    enum class phase : std::uint8_t {
        elsewhere, ///< it waits for other nodes, or they run it, or its code runs on a thread of its own
        queued,
        running,
    };
    struct totals {
        std::chrono::nanoseconds queued{0};
        std::chrono::nanoseconds ran{0};
    };

    void begin(phase next, time_point now) {
        const std::lock_guard lock{mutex_};
        count(now);
        phase_ = next;
    }
    /// What has been counted since the last call.
    [[nodiscard]] totals take(time_point now) {
        const std::lock_guard lock{mutex_};
        count(now);
        return std::exchange(counted_, {});
    }
    /// The job has been answered: nothing is counted from now on.
    void freeze(time_point now) {
        const std::lock_guard lock{mutex_};
        count(now);
        frozen_ = true;
    }
    /// For another job.
    void reset() {
        const std::lock_guard lock{mutex_};
        phase_ = phase::elsewhere;
        counted_ = {};
        frozen_ = false;
    }

  private:
    void count(time_point now) noexcept {
        const auto passed = now - std::exchange(since_, now);
        if (!frozen_ && phase_ != phase::elsewhere) {
            (phase_ == phase::queued ? counted_.queued : counted_.ran) += passed;
        }
    }

    adaptive_mutex mutex_; // of all that follows
    phase phase_ = phase::elsewhere;
    time_point since_{};
    totals counted_{};
    bool frozen_ = false;
};

} // namespace cles::runtime
