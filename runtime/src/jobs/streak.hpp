// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>

namespace cles::runtime {

/// Whether a worker may keep a result back until it has a few, so that they are fetched at once.
///
/// To be fetched, a result has the service's executor woken, which costs ten times as much as a small job, and which
/// then finds one result. So in a streak of small jobs of one task, with more of it waiting, results are kept back for
/// some tens of microseconds. A job that takes long against all expectation keeps those before it waiting, no longer
/// than until the pool looks by itself; which is why it has to be of the same task as they are.
class streak {
  public:
    static constexpr std::chrono::microseconds small_job{20};
    static constexpr std::chrono::microseconds longest_delay{50};
    static constexpr unsigned most_kept = 32;

    /// A job of that task begins. True where its result may be kept back if it comes while the worker is at it.
    bool begin(const void* task, bool more_wait, std::chrono::nanoseconds service_time, time_point now) noexcept {
        const bool goes_on = task == task_;
        task_ = task;
        may_keep_ = goes_on && more_wait && service_time < small_job && kept_ < most_kept &&
                    (kept_ == 0 || now - since_ < longest_delay);
        return may_keep_;
    }
    /// It has ended, and a job of that task comes next; null: none does. True where a result that comes now may be kept
    /// back.
    [[nodiscard]] bool goes_on(const void* next_task) const noexcept { return may_keep_ && next_task == task_; }
    void keep(time_point now) noexcept {
        if (kept_++ == 0) {
            since_ = now;
        }
    }
    /// All have been sent on their way. True where there were any.
    bool release() noexcept {
        const bool any = kept_ != 0;
        kept_ = 0;
        return any;
    }

  private:
    const void* task_ = nullptr;
    bool may_keep_ = false;
    unsigned kept_ = 0;
    time_point since_{};
};

} // namespace cles::runtime
