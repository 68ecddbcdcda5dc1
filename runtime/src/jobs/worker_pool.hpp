// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "jobs/adaptive_mutex.hpp"
#include "jobs/completion_queue.hpp"
#include "jobs/job_queue.hpp"
#include "jobs/service_time.hpp"
#include "jobs/worker_threads.hpp"
#include "jobs/worker_watchdog.hpp"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

namespace cles::runtime {

class job_record;
struct pool_options;

/// The workers and what waits for them.
///
/// A worker that is awake takes one job after another until there is none; so a worker is only woken where there is
/// more to do than are awake, and a burst of jobs costs one wake-up, not one for each.
class worker_pool {
  public:
    worker_pool(const pool_options& options, result_box& box);
    worker_pool(const worker_pool&) = delete;
    worker_pool& operator=(const worker_pool&) = delete;
    ~worker_pool() = default;

    /// To be called first, with what keeps this alive while a worker is in it. \param missed called on a worker which
    /// has found that the executor is late (`expect_executor`). The worker has put its job back and looks for no other:
    /// the executor is to call `wake` once it has read what came meanwhile.
    void start(std::weak_ptr<worker_pool> self, std::function<void()> missed) {
        self_ = std::move(self);
        missed_ = std::move(missed);
    }

    // From the service's executor:
    enum class admission : std::uint8_t {
        queued,
        wants_workers, ///< queued; `wake` has something to do, which may wait until more has come
        full,
        no_workers, ///< they are stuck, all of them
    };
    /// Queues a new job.
    [[nodiscard]] admission push(job_record& job);
    /// Wakes as many workers as have something to do.
    void wake();
    /// Takes out a job that has not begun. False where it has.
    bool take_back(job_record& job);
    /// The executor will have been back by then. Where it has not, the process was stopped, or the executor held up:
    /// workers do not know of the withdrawals that came meanwhile, and begin no job.
    void expect_executor(time_point until) noexcept { executor_due_.store(until, std::memory_order_relaxed); }
    [[nodiscard]] bool executor_is_late(time_point now) const noexcept {
        return now > executor_due_.load(std::memory_order_relaxed);
    }
    /// No job begins, and nothing is called back, until `release`. Only the executor holds, so that each hold has its
    /// release.
    void hold() noexcept;
    void release();
    /// The job has been told to stop: from now on its worker counts as late.
    void expect_end(const job_record& job, time_point now);
    /// Calls `found` for each worker that has become stuck, once replacements are at work.
    void watch(time_point now, const std::function<void(const worker_watch::finding&, const job_record&)>& found);
    /// No job begins any more. Those that have not are handed over.
    void close(const std::function<void(job_record&)>& dropped);
    /// After `close`: waits so long for the workers, which still run what is called back of jobs that have begun. With
    /// that, those that are free go on for a moment in any case. Returns how many workers are left behind in a job;
    /// one that comes back from it after all still runs what was called back.
    std::size_t join(std::chrono::milliseconds limit);

    // From anywhere:
    /// Has a part of a job that has begun run when it is its turn. False after `join`: it is dropped.
    bool resume(job_record& job, std::function<void()> part);

    [[nodiscard]] std::uint32_t queued() const noexcept { return queued_.load(std::memory_order_relaxed); }
    [[nodiscard]] std::uint32_t running() const noexcept { return running_.load(std::memory_order_relaxed); }
    [[nodiscard]] std::uint32_t usable() const noexcept { return usable_.load(std::memory_order_relaxed); }
    /// How long a job holds a worker, smoothed, in microseconds; zero where there has been none.
    [[nodiscard]] std::uint32_t service_us() const noexcept { return service_us_.load(std::memory_order_relaxed); }
    /// For how long all workers have been at their jobs, without one coming free; zero where one is free.
    [[nodiscard]] std::chrono::nanoseconds held_for(time_point now) const noexcept;
    struct figures {
        std::uint64_t stuck = 0;
        std::uint64_t replaced = 0;
        std::uint64_t revived = 0;
        std::uint32_t stuck_now = 0;
        std::chrono::nanoseconds service_time{0};
    };
    [[nodiscard]] figures count() const;

  private:
    void work();
    void part_with(job_record* job, bool may_keep, streak& so_far, time_point now,
                   std::vector<std::function<void()>>& dropped);
    void enlist();
    void put_back(job_record& job);
    void drop_called_back();
    [[nodiscard]] bool wants_worker() const noexcept;
    void mirror() noexcept;
    void note_progress(time_point now) noexcept;

    result_box& box_;
    worker_threads threads_;
    std::weak_ptr<worker_pool> self_;
    std::function<void()> missed_;
    std::atomic<time_point> executor_due_{time_point::max()};
    mutable brief_mutex mutex_; // of all that follows
    job_queue queue_;
    worker_watch watch_;
    std::size_t awake_ = 0; // workers that look for jobs or are about to
    std::uint32_t at_work_ = 0;
    service_time service_time_;
    figures figures_;
    bool held_ = false;   // no job begins, and nothing is called back
    bool closed_ = false; // no job begins
    bool ended_ = false;  // nothing is called back
    std::condition_variable_any at_rest_;
    // The same for those who only look.
    std::atomic<std::uint32_t> queued_{0};
    std::atomic<std::uint32_t> running_{0};
    std::atomic<std::uint32_t> usable_{0};
    std::atomic<std::uint32_t> service_us_{0};
    std::atomic<time_point::rep> held_since_{0}; // 0: a worker is free
};

} // namespace cles::runtime
