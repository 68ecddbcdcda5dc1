// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "jobs/adaptive_mutex.hpp"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

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

class job_record;

/// What workers and other threads have for the service's executor. The first thing in it wakes the executor, which
/// takes out all that has gathered when it comes.
class result_box {
  public:
    enum class news : std::uint8_t {
        progress,
        ended, ///< there is an answer
        gone,  ///< nobody holds the job any more
    };
    struct item {
        job_record* record; ///< with one reference to it, but for what is gone
        news what;
    };
    using errand = std::function<void()>;

    /// `wake` is called, from any thread, to have `take` called soon.
    explicit result_box(std::function<void()> wake) : wake_(std::move(wake)) {}
    result_box(const result_box&) = delete;
    result_box& operator=(const result_box&) = delete;
    ~result_box() = default;

    /// False once it has been closed. `in_time`: without a wake-up, when the executor comes by anyway.
    [[nodiscard]] bool put(item what, bool in_time = false);
    /// Has what was put in with time fetched now.
    void flush();
    /// Something to be run on the executor. False once it has been closed, or where too many wait.
    [[nodiscard]] bool put(errand what);
    /// Exchanges what is there for two empty lists.
    void take(std::vector<item>& items, std::vector<errand>& errands);
    /// Takes nothing from now on, and hands over what is there. Once it returns, nobody wakes the executor any more.
    void close(std::vector<item>& items, std::vector<errand>& errands);

  private:
    static constexpr std::size_t most_errands = 4096;

    [[nodiscard]] bool wakes() noexcept;
    void wake();

    std::function<void()> wake_;
    brief_mutex mutex_;
    std::vector<item> items_;
    std::vector<errand> errands_;
    std::atomic<int> waking_{0};
    bool woken_ = false;
    bool closed_ = false;
};

} // namespace cles::runtime
