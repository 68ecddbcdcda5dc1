// SPDX-License-Identifier: BSL-1.0
#include "jobs/worker_pool.hpp"

#include "jobs/job_pool.hpp"

#include <boost/asio/post.hpp>

#include <algorithm>
#include <iterator>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

namespace cles::runtime {
namespace {

using clock = time_point::clock;

constexpr std::size_t max_workers = 1024;
constexpr std::size_t max_replacements = 1024;
// How long free workers have at the end for continuations, whatever the others do.
constexpr std::chrono::milliseconds final_grace{500};

std::size_t worker_count(const pool_options& options) {
    const std::size_t wanted = options.workers != 0 ? options.workers : std::thread::hardware_concurrency();
    return std::clamp<std::size_t>(wanted, 1, max_workers);
}

} // namespace

worker_pool::worker_pool(const pool_options& options, completion_queue& completions)
    : completions_(completions), threads_(worker_count(options)), queue_(std::max<std::size_t>(options.queue, 1)),
      watchdog_(worker_count(options), std::min<std::size_t>(options.replacements, max_replacements), options.grace) {}

// -- the queue -----------------------------------------------------------------------------------------------------

bool worker_pool::needs_worker() const noexcept {
    // Workers that are awake without a job are about to take one.
    return !ended_ && !paused_ && awake_ < watchdog_.allowed() && queue_.size() > awake_ - busy_;
}

// With the lock.
job_record* worker_pool::pop() noexcept { return static_cast<job_record*>(queue_.pop()); }

// With the lock. The job is the first of its requester.
void worker_pool::resume(job_record& job) {
    job.state = job_record::run_state::queued;
    job.note_phase(job_times::phase::queued);
    queue_.push_resumed(job);
}

worker_pool::admission worker_pool::push(job_record& job) {
    const std::lock_guard lock{mutex_};
    if (closed_ || watchdog_.usable() == 0) {
        return admission::no_workers;
    }
    if (!queue_.push(job)) {
        return admission::full;
    }
    job.state = job_record::run_state::queued;
    job.started = false;
    return needs_worker() ? admission::needs_wake : admission::queued;
}

bool worker_pool::schedule(job_record& job, std::function<void()> continuation) {
    bool wanted = false;
    {
        const std::lock_guard lock{mutex_};
        if (ended_) {
            return false;
        }
        job.continuations.push_back(std::move(continuation));
        if (job.state != job_record::run_state::idle) {
            return true; // its turn comes
        }
        job.add_reference();
        resume(job);
        wanted = needs_worker();
        awake_ += wanted ? 1 : 0;
    }
    if (wanted) {
        schedule_worker();
    }
    return true;
}

bool worker_pool::withdraw(job_record& job) {
    const std::lock_guard lock{mutex_};
    if (job.state != job_record::run_state::queued || job.started) {
        return false;
    }
    queue_.remove(job);
    job.state = job_record::run_state::idle;
    return true;
}

bool worker_pool::is_waiting(const job_record& job) const {
    const std::lock_guard lock{mutex_};
    return job.state == job_record::run_state::queued && !job.started;
}

bool worker_pool::put_back(job_record& job) {
    const std::lock_guard lock{mutex_};
    if (closed_) {
        return false;
    }
    queue_.put_back(job);
    job.state = job_record::run_state::queued;
    job.note_phase(job_times::phase::queued);
    return true;
}

bool worker_pool::notify_when_free() {
    const std::lock_guard lock{mutex_};
    notify_free_ = busy_ >= watchdog_.usable();
    return notify_free_;
}

void worker_pool::pause() noexcept {
    const std::lock_guard lock{mutex_};
    paused_ = !closed_;
}

void worker_pool::unpause() {
    {
        const std::lock_guard lock{mutex_};
        paused_ = false;
    }
    wake();
}

void worker_pool::job_stopped(const job_record& job, time_point now) {
    const std::lock_guard lock{mutex_};
    if (job.state == job_record::run_state::running) {
        watchdog_.stop(job.worker_slot, &job, now);
    }
}

void worker_pool::close() {
    std::vector<job_record*> left;
    {
        const std::lock_guard lock{mutex_};
        closed_ = true;
        paused_ = false;
        executor_due_.store(time_point::max(), std::memory_order_relaxed); // no input is read any more
        std::vector<job_record*> started;
        while (auto* job = pop()) {
            job->state = job_record::run_state::idle;
            (job->started ? started : left).push_back(job);
        }
        for (auto* job : started) {
            resume(*job);
        }
    }
    for (auto* job : left) {
        job->release();
    }
}

std::size_t worker_pool::join(std::chrono::milliseconds limit) {
    const auto end = std::chrono::steady_clock::now() + limit;
    wake();
    {
        std::unique_lock lock{mutex_};
        idle_.wait_until(lock, end, [this] { return queue_.empty() && busy_ == 0; });
        idle_.wait_for(lock, final_grace, [this] { return queue_.empty() || busy_ >= watchdog_.allowed(); });
        ended_ = true;
    }
    const auto time_left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    const auto left = threads_.stop(std::max(time_left, {}), read_figures().running);
    if (left == 0) {
        drop_continuations();
    }
    return left;
}

// Drops the continuations of jobs that no worker took.
void worker_pool::drop_continuations() {
    std::vector<std::function<void()>> dropped;
    std::vector<job_record*> left;
    {
        const std::lock_guard lock{mutex_};
        while (auto* job = pop()) {
            job->state = job_record::run_state::idle;
            std::move(job->continuations.begin(), job->continuations.end(), std::back_inserter(dropped));
            job->continuations.clear();
            left.push_back(job);
        }
    }
    dropped.clear();
    for (auto* job : left) {
        job->release();
    }
}

// -- workers -------------------------------------------------------------------------------------------------------

void worker_pool::wake() {
    for (;;) {
        {
            const std::lock_guard lock{mutex_};
            if (!needs_worker()) {
                return;
            }
            ++awake_;
        }
        schedule_worker();
    }
}

void worker_pool::schedule_worker() {
    boost::asio::post(threads_.get_executor(), [weak = self_] {
        if (const auto self = weak.lock()) {
            self->work();
        }
    });
}

// Releases a job that the worker does not run any more, and hands over results that must not wait.
void worker_pool::finish_job(job_record* job, bool may_defer, completion_batcher& batcher, time_point now,
                             std::vector<std::function<void()>>& dropped) {
    dropped.clear();
    if (job != nullptr && job->finish_run(may_defer) && may_defer) {
        batcher.deferred(now);
    }
    if (!may_defer && batcher.flush()) {
        completions_.flush();
    }
}

void worker_pool::work() {
    std::vector<std::function<void()>> dropped;
    job_record* done = nullptr;
    completion_batcher batcher;
    job_record::current_run here;
    job_record::set_current_run(&here);
    std::unique_lock lock{mutex_};
    const auto slot = watchdog_.enter();
    auto now = clock::now();
    bool executor_late = false;
    while (awake_ <= watchdog_.allowed() && !paused_) {
        auto* next = pop();
        if (next == nullptr) {
            break;
        }
        auto& job = *next;
        const bool starts = !std::exchange(job.started, true);
        job.state = job_record::run_state::running;
        job.worker_slot = slot;
        watchdog_.begin(slot, &job, now, job.request().deadline());
        ++busy_;
        last_begin_ = now;
        std::vector<std::function<void()>> continuations;
        continuations.swap(job.continuations);
        const bool may_defer_last = batcher.may_defer_before(job.task());
        here = {.job = &job, .may_defer = false, .deferred = false};
        const bool more_queued = !queue_.empty();
        const auto average = service_time_.value();
        lock.unlock();

        finish_job(done, may_defer_last, batcher, now, dropped);
        here.may_defer = batcher.begin_job(job.task(), more_queued, average, now);
        executor_late = starts && !job.start(executor_due_.load(std::memory_order_relaxed));
        if (!executor_late) {
            for (const auto& continuation : continuations) {
                job.run(continuation);
            }
            dropped.swap(continuations);
        }

        const auto ended = clock::now();
        if (here.deferred) {
            batcher.deferred(ended);
        }
        lock.lock();
        --busy_;
        counts_.revived += watchdog_.end(slot) ? 1 : 0;
        executor_late = executor_late && !closed_; // at the end it is dropped
        if (executor_late) {
            done = nullptr;
            job.started = false;
            resume(job); // as before
            break;
        }
        service_time_.add(ended - now, ended);
        task_times_.add(job.task(), ended - now, ended);
        now = ended;
        done = &job;
        job.state = job_record::run_state::idle;
        if (!job.continuations.empty()) {
            resume(job); // with the worker's reference
            done = nullptr;
        }
        if (closed_) {
            idle_.notify_all();
        }
    }
    watchdog_.leave(slot);
    --awake_;
    const bool notify_free = std::exchange(notify_free_, false);
    lock.unlock();
    finish_job(done, false, batcher, now, dropped);
    job_record::set_current_run(nullptr);
    if (notify_free) {
        on_free_();
    }
    if (executor_late) {
        on_executor_late_();
    }
}

std::vector<worker_pool::stuck_job> worker_pool::check_stuck(time_point now) {
    std::vector<stuck_job> all;
    std::size_t threads = 0;
    {
        const std::lock_guard lock{mutex_};
        watchdog_.check(now, [&](const worker_watchdog::stuck_worker& what) {
            auto* job = const_cast<job_record*>(static_cast<const job_record*>(what.job)); // NOLINT
            all.push_back({what, job_ptr{job}});
            ++counts_.stuck;
            counts_.replaced += what.replaced ? 1 : 0;
        });
        threads = watchdog_.allowed();
    }
    if (!all.empty()) {
        try {
            while (threads_.count() < threads) {
                threads_.add();
            }
        } catch (const std::system_error&) {
            // There is one worker less; jobs in the queue end at their deadlines.
        }
        wake();
    }
    return all;
}

worker_pool::figures worker_pool::read_figures() const noexcept {
    const auto now = clock::now();
    const std::lock_guard lock{mutex_};
    auto result = counts_;
    result.stuck_now = static_cast<std::uint32_t>(watchdog_.stuck());
    result.queued = static_cast<std::uint32_t>(queue_.size());
    result.movable = static_cast<std::uint32_t>(queue_.movable());
    result.movable_queued = queue_.movable_queued();
    result.running = busy_;
    result.usable = static_cast<std::uint32_t>(watchdog_.usable());
    result.service_time = service_time_.value();
    result.recent_service_time = service_time_.recent(now);
    if (busy_ >= watchdog_.allowed()) {
        result.saturated_for = std::max<std::chrono::nanoseconds>(now - last_begin_, {});
    }
    return result;
}

} // namespace cles::runtime
