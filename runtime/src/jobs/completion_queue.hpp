// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "jobs/adaptive_mutex.hpp"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <utility>
#include <vector>

namespace cles::runtime {

/// Decides whether a worker may hold back a result in order to hand over several at once.
///
/// Handing over a result wakes the service's executor, which costs ten times as much as a small job. So in a series of
/// small jobs of one task, with more of them queued, results are deferred for some tens of microseconds. A job that
/// unexpectedly takes long delays the deferred results until the pool's timer collects them, which is why it has to be
/// of the same task.
class completion_batcher {
  public:
    static constexpr std::chrono::microseconds small_job{20};
    static constexpr std::chrono::microseconds max_delay{50};
    static constexpr unsigned max_deferred = 32;

    /// A job of that task begins. Returns whether a result may be deferred if it is given while the job runs.
    bool begin_job(const void* task, bool more_queued, std::chrono::nanoseconds service_time, time_point now) noexcept {
        const bool same_task = task == task_;
        task_ = task;
        may_defer_ = same_task && more_queued && service_time < small_job && deferred_ < max_deferred &&
                     (deferred_ == 0 || now - since_ < max_delay);
        return may_defer_;
    }
    /// The job has ended, and a job of that task comes next (null: none). Returns whether a result that is given now
    /// may be deferred.
    [[nodiscard]] bool may_defer_before(const void* next_task) const noexcept {
        return may_defer_ && next_task == task_;
    }
    /// A result has been deferred.
    void deferred(time_point now) noexcept {
        if (deferred_++ == 0) {
            since_ = now;
        }
    }
    /// All deferred results are being handed over. Returns whether there were any.
    bool flush() noexcept {
        const bool any = deferred_ != 0;
        deferred_ = 0;
        return any;
    }

  private:
    const void* task_ = nullptr;
    bool may_defer_ = false;
    unsigned deferred_ = 0;
    time_point since_{};
};

class job_record;

/// What workers and other threads hand to the service's executor. The first entry wakes the executor, which takes all
/// that have gathered by the time it runs.
class completion_queue {
  public:
    enum class event : std::uint8_t {
        progress,
        answered,
        released, ///< the last reference to the job is gone
    };
    struct entry {
        job_record* record; ///< with one reference, except for `released`
        event what;
    };
    using function = std::function<void()>;

    /// `wake` is called, from any thread, to have `take` called soon.
    explicit completion_queue(std::function<void()> wake) : wake_(std::move(wake)) {}
    completion_queue(const completion_queue&) = delete;
    completion_queue& operator=(const completion_queue&) = delete;
    ~completion_queue() = default;

    /// False once it has been closed. \param deferred does not wake the executor: the entry is taken with the next ones
    [[nodiscard]] bool push(entry what, bool deferred = false);
    /// Wakes the executor for deferred entries.
    void flush();
    /// Queues a function to run on the executor. False once it has been closed, or when too many are queued.
    [[nodiscard]] bool post(function what);
    /// The same, however many are queued: for what has a limit of its own.
    [[nodiscard]] bool post_always(function what);
    /// Swaps the contents with two empty lists.
    void take(std::vector<entry>& entries, std::vector<function>& functions);
    /// Accepts nothing more, and hands over the contents. Once it returns, no thread wakes the executor any more.
    void close(std::vector<entry>& entries, std::vector<function>& functions);

  private:
    static constexpr std::size_t max_functions = 4096;

    bool post(function what, std::size_t most);
    void wake(std::unique_lock<adaptive_mutex>& lock);

    std::function<void()> wake_;
    adaptive_mutex mutex_;
    std::vector<entry> entries_;
    std::vector<function> functions_;
    std::atomic<int> wakers_{0};
    bool woken_ = false;
    bool closed_ = false;
};

} // namespace cles::runtime
