// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "jobs/adaptive_mutex.hpp"
#include "jobs/completion_queue.hpp"
#include "jobs/job_queue.hpp"
#include "jobs/job_record.hpp"
#include "jobs/service_time.hpp"
#include "jobs/worker_threads.hpp"
#include "jobs/worker_watchdog.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

namespace cles::runtime {

struct pool_options;

/// The workers, and the jobs that wait for them.
///
/// A worker that is awake takes one job after another until there are none. A worker is woken only if there are more
/// jobs than workers awake, so that a burst of jobs costs one wake-up, not one for each.
class worker_pool {
  public:
    worker_pool(const pool_options& options, completion_queue& completions);
    worker_pool(const worker_pool&) = delete;
    worker_pool& operator=(const worker_pool&) = delete;
    ~worker_pool() = default;

    /// To be called first. \param self keeps this alive while a worker uses it \param on_executor_late called on a
    /// worker that found the executor late (`set_executor_due`). The worker has put its job back and looks for no
    /// other: the executor has to call `wake` once it has read the input that arrived in the meantime.
    void start(std::weak_ptr<worker_pool> self, std::function<void()> on_executor_late,
               std::function<void()> on_free = {}) {
        self_ = std::move(self);
        on_executor_late_ = std::move(on_executor_late);
        on_free_ = std::move(on_free);
    }

    // On the service's executor:
    enum class admission : std::uint8_t {
        queued,
        needs_wake, ///< queued; `wake` has to be called, perhaps after more jobs were pushed
        full,
        no_workers, ///< all workers are stuck
    };
    /// Queues a new job.
    [[nodiscard]] admission push(job_record& job);
    /// Wakes as many workers as there are jobs for.
    void wake();
    /// Removes a job that has not started. False if it has.
    bool withdraw(job_record& job);
    /// Whether the job waits for its first worker.
    [[nodiscard]] bool is_waiting(const job_record& job) const;
    /// Removes movable jobs: those that `choose(job, ahead, service_time)` returns true for, in the order in which they
    /// would start, until `full()` does. \param most how many are looked at, among 16 times as many jobs
    template <class Choose, class Full>
    [[nodiscard]] std::vector<job_record*> take(std::size_t most, Choose choose, Full full);
    /// Queues a job that `take` has removed, at its old place. False after `close`.
    [[nodiscard]] bool put_back(job_record& job);
    /// Has `on_free` called, on a worker, when the next worker becomes free. False if one is free already.
    [[nodiscard]] bool notify_when_free();
    /// By when the executor's timer will have run. If it has not, the process was suspended or the executor blocked:
    /// workers may have missed withdrawals, and start no job.
    void set_executor_due(time_point until) noexcept { executor_due_.store(until, std::memory_order_relaxed); }
    [[nodiscard]] bool executor_is_late(time_point now) const noexcept {
        return now > executor_due_.load(std::memory_order_relaxed);
    }
    /// No job or continuation starts until `unpause`.
    void pause() noexcept;
    void unpause();
    /// The job has been told to stop: its grace period begins.
    void job_stopped(const job_record& job, time_point now);
    struct stuck_job {
        worker_watchdog::stuck_worker worker;
        job_ptr job;
    };
    /// The workers that have become stuck. Adds replacements.
    [[nodiscard]] std::vector<stuck_job> check_stuck(time_point now);
    /// No job starts any more. Jobs that have not started are released.
    void close();
    /// After `close`: waits up to the limit for the workers, which still run the continuations of started jobs; free
    /// workers get a moment for that in any case. Returns how many workers are abandoned in a job; one whose job ends
    /// after all still runs its continuations.
    std::size_t join(std::chrono::milliseconds limit);

    // On any thread:
    /// Queues a continuation of a job that has started. False after `join`: it is dropped.
    bool schedule(job_record& job, std::function<void()> continuation);

    struct figures {
        std::uint64_t stuck = 0;
        std::uint64_t replaced = 0;
        std::uint64_t revived = 0;
        std::uint32_t stuck_now = 0;
        std::uint32_t queued = 0;
        std::uint32_t movable = 0;        ///< of these
        std::uint64_t movable_queued = 0; ///< since the start
        std::uint32_t running = 0;
        std::uint32_t usable = 0;                        ///< workers that are not stuck
        std::chrono::nanoseconds service_time{0};        ///< how long a job holds a worker; zero before the first job
        std::chrono::nanoseconds recent_service_time{0}; ///< the same; zero also if no job has ended lately
        std::chrono::nanoseconds saturated_for{0};       ///< how long all workers have been busy; zero if one is free
    };
    [[nodiscard]] figures read_figures() const noexcept;

  private:
    void work();
    void finish_job(job_record* job, bool may_defer, completion_batcher& batcher, time_point now,
                    std::vector<std::function<void()>>& dropped);
    void schedule_worker();
    job_record* pop() noexcept;
    void resume(job_record& job);
    void drop_continuations();
    [[nodiscard]] bool needs_worker() const noexcept;

    completion_queue& completions_;
    worker_threads threads_;
    std::weak_ptr<worker_pool> self_;
    std::function<void()> on_executor_late_;
    std::function<void()> on_free_;
    std::atomic<time_point> executor_due_{time_point::max()};
    mutable adaptive_mutex mutex_; // of all that follows
    job_queue queue_;
    worker_watchdog watchdog_;
    std::size_t awake_ = 0; // workers that look for jobs, or are about to
    std::uint32_t busy_ = 0;
    time_point last_begin_; // of a job
    service_time service_time_;
    task_times task_times_;
    figures counts_;      // its first three
    bool paused_ = false; // no job or continuation starts
    bool closed_ = false; // no job starts
    bool ended_ = false;  // no continuation starts
    bool notify_free_ = false;
    std::condition_variable_any idle_;
};

template <class Choose, class Full>
std::vector<job_record*> worker_pool::take(std::size_t most, Choose choose, Full full) {
    std::vector<job_record*> taken;
    const std::lock_guard lock{mutex_};
    auto left = std::min(most, queue_.movable());
    queue_.visit([&](job_queue::item& each, std::size_t ahead) {
        auto& job = static_cast<job_record&>(each);
        if (job.movable) {
            --left;
            if (choose(job, ahead, task_times_.of(job.task()))) {
                taken.push_back(&job);
            }
        }
        return left != 0 && ahead + 1 < 16 * most && !full();
    });
    for (auto* job : taken) {
        queue_.remove(*job);
        job->state = job_record::run_state::idle;
    }
    return taken;
}

} // namespace cles::runtime
