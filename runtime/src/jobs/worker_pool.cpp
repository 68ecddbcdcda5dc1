// SPDX-License-Identifier: BSL-1.0
#include "jobs/worker_pool.hpp"

#include "jobs/job_pool.hpp"
#include "jobs/job_record.hpp"

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

constexpr std::size_t most_workers = 1024;
constexpr std::int64_t longest_told = 1'000'000'000; // microseconds
constexpr std::size_t most_replacements = 1024;
// How long free workers have at the end for what is called back, whatever those are at that are not free.
constexpr std::chrono::milliseconds last_turn{500};

std::size_t workers_of(const pool_options& options) {
    const std::size_t wanted = options.workers != 0 ? options.workers : std::thread::hardware_concurrency();
    return std::clamp<std::size_t>(wanted, 1, most_workers);
}

} // namespace

worker_pool::worker_pool(const pool_options& options, result_box& box)
    : box_(box), threads_(workers_of(options)), queue_(std::max<std::size_t>(options.queue, 1)),
      watch_(workers_of(options), std::min<std::size_t>(options.replacements, most_replacements), options.grace) {
    mirror();
}

// -- what waits ----------------------------------------------------------------------------------------------------

bool worker_pool::wants_worker() const noexcept {
    // Those that are awake and have no job yet are about to take one.
    return !ended_ && !held_ && awake_ < watch_.allowed() && queue_.size() > awake_ - at_work_;
}

void worker_pool::mirror() noexcept {
    queued_.store(static_cast<std::uint32_t>(queue_.size()), std::memory_order_relaxed);
    running_.store(at_work_, std::memory_order_relaxed);
    usable_.store(static_cast<std::uint32_t>(watch_.usable()), std::memory_order_relaxed);
    // Rounded up, since zero says that nothing is known.
    service_us_.store(
        static_cast<std::uint32_t>(std::min<std::int64_t>((service_time_.value().count() + 999) / 1000, longest_told)),
        std::memory_order_relaxed);
}

// To be called when a worker begins or ends a job.
void worker_pool::note_progress(time_point now) noexcept {
    const bool all = at_work_ >= watch_.allowed();
    held_since_.store(all ? now.time_since_epoch().count() : 0, std::memory_order_relaxed);
}

std::chrono::nanoseconds worker_pool::held_for(time_point now) const noexcept {
    const auto since = held_since_.load(std::memory_order_relaxed);
    return since == 0 ? std::chrono::nanoseconds{0}
                      : std::max<std::chrono::nanoseconds>(now - time_point{time_point::duration{since}}, {});
}

worker_pool::admission worker_pool::push(job_record& job) {
    const std::lock_guard lock{mutex_};
    if (closed_ || watch_.usable() == 0) {
        return admission::no_workers;
    }
    if (!queue_.push(job)) {
        return admission::full;
    }
    job.where = job_record::place::queued;
    job.begun = false;
    mirror();
    return wants_worker() ? admission::wants_workers : admission::queued;
}

bool worker_pool::resume(job_record& job, std::function<void()> part) {
    bool wanted = false;
    {
        const std::lock_guard lock{mutex_};
        if (ended_) {
            return false;
        }
        job.called_back.push_back(std::move(part));
        if (job.where != job_record::place::nowhere) {
            return true; // it comes to it
        }
        job.add_reference();
        job.where = job_record::place::queued;
        queue_.push_begun(job);
        mirror();
        wanted = wants_worker();
        awake_ += wanted ? 1 : 0;
    }
    if (wanted) {
        enlist();
    }
    return true;
}

bool worker_pool::take_back(job_record& job) {
    const std::lock_guard lock{mutex_};
    if (job.where != job_record::place::queued || job.begun) {
        return false;
    }
    queue_.remove(job);
    job.where = job_record::place::nowhere;
    mirror();
    return true;
}

void worker_pool::hold() noexcept {
    const std::lock_guard lock{mutex_};
    held_ = !closed_;
}

void worker_pool::release() {
    {
        const std::lock_guard lock{mutex_};
        held_ = false;
    }
    wake();
}

void worker_pool::expect_end(const job_record& job, time_point now) {
    const std::lock_guard lock{mutex_};
    if (job.where == job_record::place::at_work) {
        watch_.stop(job.worker, &job, now);
    }
}

void worker_pool::close(const std::function<void(job_record&)>& dropped) {
    std::vector<job_record*> left;
    {
        const std::lock_guard lock{mutex_};
        closed_ = true;
        held_ = false;
        executor_due_.store(time_point::max(), std::memory_order_relaxed); // nothing is read any more
        std::vector<job_record*> begun;
        while (auto* next = queue_.pop()) {
            auto& job = static_cast<job_record&>(*next);
            if (job.begun) {
                begun.push_back(&job);
            } else {
                job.where = job_record::place::nowhere;
                left.push_back(&job);
            }
        }
        for (auto* job : begun) {
            queue_.push_begun(*job);
        }
        mirror();
    }
    for (auto* job : left) {
        dropped(*job);
    }
}

std::size_t worker_pool::join(std::chrono::milliseconds limit) {
    const auto end = std::chrono::steady_clock::now() + limit;
    wake();
    {
        std::unique_lock lock{mutex_};
        at_rest_.wait_until(lock, end, [this] { return queue_.empty() && at_work_ == 0; });
        at_rest_.wait_for(lock, last_turn, [this] { return queue_.empty() || at_work_ >= watch_.allowed(); });
        ended_ = true;
    }
    const auto time_left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    const auto left = threads_.stop(std::max(time_left, {}), running());
    if (left == 0) {
        drop_called_back();
    }
    return left;
}

// Of jobs that no worker came to.
void worker_pool::drop_called_back() {
    std::vector<std::function<void()>> parts;
    std::vector<job_record*> left;
    {
        const std::lock_guard lock{mutex_};
        while (auto* next = queue_.pop()) {
            auto& job = static_cast<job_record&>(*next);
            job.where = job_record::place::nowhere;
            std::move(job.called_back.begin(), job.called_back.end(), std::back_inserter(parts));
            job.called_back.clear();
            left.push_back(&job);
        }
        mirror();
    }
    parts.clear();
    for (auto* job : left) {
        job->release();
    }
}

// -- workers -------------------------------------------------------------------------------------------------------

void worker_pool::wake() {
    for (;;) {
        {
            const std::lock_guard lock{mutex_};
            if (!wants_worker()) {
                return;
            }
            ++awake_;
        }
        enlist();
    }
}

void worker_pool::enlist() {
    boost::asio::post(threads_.get_executor(), [weak = self_] {
        if (const auto self = weak.lock()) {
            self->work();
        }
    });
}

// What a worker does with a job when it no longer counts as being at it.
void worker_pool::part_with(job_record* job, bool may_keep, streak& so_far, time_point now,
                            std::vector<std::function<void()>>& dropped) {
    dropped.clear();
    if (job != nullptr && job->settle(may_keep) && may_keep) {
        so_far.keep(now);
    }
    if (!may_keep && so_far.release()) {
        box_.flush();
    }
}

// With the lock: a job that the worker has taken, but must not begin.
void worker_pool::put_back(job_record& job) {
    job.begun = false;
    job.where = job_record::place::queued;
    queue_.push_begun(job); // the next one of its requester, as it was
}

void worker_pool::work() {
    std::vector<std::function<void()>> parts;
    job_record* done = nullptr;
    streak so_far;
    job_record::at_work here;
    job_record::set_at_work(&here);
    std::unique_lock lock{mutex_};
    const auto place = watch_.enter();
    auto now = clock::now();
    bool missed = false;
    while (awake_ <= watch_.allowed() && !held_) {
        auto* next = queue_.pop();
        if (next == nullptr) {
            break;
        }
        auto& job = static_cast<job_record&>(*next);
        const bool begins = !std::exchange(job.begun, true);
        job.where = job_record::place::at_work;
        job.worker = place;
        watch_.begin(place, &job, now, job.request().deadline());
        ++at_work_;
        note_progress(now);
        mirror();
        std::vector<std::function<void()>> now_due;
        now_due.swap(job.called_back);
        const bool may_keep_last = so_far.goes_on(job.task());
        here = {.job = &job, .may_keep = false, .kept = false};
        const bool more_wait = !queue_.empty();
        const auto usual = service_time_.value();
        lock.unlock();

        part_with(done, may_keep_last, so_far, now, parts);
        here.may_keep = so_far.begin(job.task(), more_wait, usual, now);
        missed = begins && !job.begin(executor_due_.load(std::memory_order_relaxed));
        if (!missed) {
            for (const auto& part : now_due) {
                job.run(part);
            }
            parts.swap(now_due);
        }

        const auto ended = clock::now();
        if (here.kept) {
            so_far.keep(ended);
        }
        lock.lock();
        --at_work_;
        note_progress(now);
        figures_.revived += watch_.end(place) ? 1 : 0;
        missed = missed && !closed_; // at the end it is dropped
        if (missed) {
            done = nullptr;
            put_back(job);
            mirror();
            break;
        }
        service_time_.add(ended - now);
        now = ended;
        done = &job;
        job.where = job_record::place::nowhere;
        if (!job.called_back.empty()) {
            job.where = job_record::place::queued;
            queue_.push_begun(job); // with the worker's reference
            done = nullptr;
        }
        mirror();
        if (closed_) {
            at_rest_.notify_all();
        }
    }
    watch_.leave(place);
    --awake_;
    lock.unlock();
    part_with(done, false, so_far, now, parts);
    job_record::set_at_work(nullptr);
    if (missed) {
        missed_();
    }
}

void worker_pool::watch(time_point now,
                        const std::function<void(const worker_watch::finding&, const job_record&)>& found) {
    struct lost {
        worker_watch::finding what;
        job_record* job;
    };
    std::vector<lost> all;
    std::size_t threads = 0;
    {
        const std::lock_guard lock{mutex_};
        watch_.check(now, [&](const worker_watch::finding& what) {
            auto* job = const_cast<job_record*>(static_cast<const job_record*>(what.job)); // NOLINT
            job->add_reference();
            all.push_back({what, job});
            ++figures_.stuck;
            figures_.replaced += what.replaced ? 1 : 0;
        });
        threads = watch_.allowed();
        if (at_work_ < threads) { // another has taken the place of one that was stuck
            held_since_.store(0, std::memory_order_relaxed);
        }
        mirror();
    }
    for (const auto& each : all) {
        try {
            while (threads_.count() < threads) {
                threads_.add();
            }
        } catch (const std::system_error&) {
            // It is one less, then; what waits is told at its deadline.
        }
        found(each.what, *each.job);
        each.job->release();
    }
    if (!all.empty()) {
        wake();
    }
}

worker_pool::figures worker_pool::count() const {
    const std::lock_guard lock{mutex_};
    auto result = figures_;
    result.stuck_now = static_cast<std::uint32_t>(watch_.stuck());
    result.service_time = service_time_.value();
    return result;
}

} // namespace cles::runtime
