// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/jobs.hpp>
#include <cles/log.hpp>
#include <cles/peer.hpp>
#include <cles/registrar.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>
#include <cles/service.hpp>
#include <cles/sharing.hpp>

#include "jobs/adaptive_mutex.hpp"
#include "jobs/completion_queue.hpp"
#include "jobs/delegated_requests.hpp"
#include "jobs/job_feeds.hpp"
#include "jobs/job_record.hpp"
#include "jobs/pause_detector.hpp"
#include "jobs/stop_notifier.hpp"
#include "jobs/worker_pool.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/describe/class.hpp>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::runtime {

/// The settings of a pool of workers.
struct pool_options {
    unsigned workers = 0;      ///< threads; 0: as many as there are cores
    std::size_t queue = 1024;  ///< jobs that may wait; further ones are refused with `busy`
    unsigned replacements = 4; ///< how many stuck workers may be replaced
    /// A job is stuck if it still holds its worker this long after its deadline, or after its requester withdrew.
    std::chrono::milliseconds grace{2'000};
    /// How long the destructor waits for workers that run a job, before it abandons them.
    std::chrono::milliseconds close_timeout{2'000};
    /// After the service's executor has waited longer than this, for whatever reason, no job starts until the input
    /// that has arrived, above all withdrawals, has been read. 0: not checked.
    std::chrono::milliseconds max_wait{0};
    /// How often a timer runs on the executor, even without jobs. If the timer is late by more than
    /// `executor_lateness`, the process was suspended or the executor was blocked, which is logged. 0: not checked, for
    /// an executor that does not run all the time.
    std::chrono::milliseconds check_interval{0};
    std::chrono::milliseconds executor_lateness{250};
    /// A handler on the I/O thread (`inline_ok`) that takes longer is logged.
    std::chrono::microseconds slow_inline{5'000};
    log_sink log{}; ///< called on the service's executor
};

/// The counters of a pool of workers since its start, and its current state.
struct pool_figures {
    std::uint64_t admitted = 0;        ///< jobs that were queued: these are open, withdrawn, moved or answered
    std::uint64_t refused = 0;         ///< with `busy`: the queue was full, or the pool was draining
    std::uint64_t withdrawn = 0;       ///< removed from the queue before they started
    std::uint64_t moved = 0;           ///< ended at another node
    std::uint64_t answered = 0;        ///< ended with a result, or a failure of their own
    std::uint64_t threw = 0;           ///< whose handler threw
    std::uint64_t answerless = 0;      ///< ended without an answer, because its last holder was destroyed
    std::uint64_t answered_twice = 0;  ///< further answers to a job that had been answered
    std::uint64_t logs_dropped = 0;    ///< log entries that came too fast
    std::uint64_t stuck = 0;           ///< jobs that did not end in time, so far
    std::uint64_t replaced = 0;        ///< of these, those whose worker was replaced
    std::uint64_t revived = 0;         ///< of these, those that ended after all
    std::uint64_t inline_calls = 0;    ///< handlers that ran on the I/O thread
    std::uint64_t inline_slow = 0;     ///< of these, those that took longer than `slow_inline`
    std::uint64_t inline_worst_us = 0; ///< the longest inline call

    std::uint32_t queued = 0;
    std::uint32_t running = 0;         ///< on workers
    std::uint32_t waiting = 0;         ///< started, but on no worker: they wait for other nodes
    std::uint32_t workers = 0;         ///< that are not stuck
    std::uint32_t stuck_now = 0;       ///< workers that are
    std::uint64_t service_time_us = 0; ///< how long a job holds a worker, smoothed
};
BOOST_DESCRIBE_STRUCT(pool_figures, (),
                      (admitted, refused, withdrawn, moved, answered, threw, answerless, answered_twice, logs_dropped,
                       stuck, replaced, revived, inline_calls, inline_slow, inline_worst_us, queued, running, waiting,
                       workers, stuck_now, service_time_us))

/// How a drain ended.
struct drain_report {
    std::size_t refused = 0;   ///< jobs that had not started and were answered `busy`
    std::size_t abandoned = 0; ///< jobs that had started or moved to other nodes, and were answered `unavailable`
    std::size_t stuck = 0;     ///< jobs that still hold a worker
};

/// Takes the jobs of a pool, on the service's executor, from admission to reply: it is the sequence of these steps, and
/// its parts keep their state. It lives as long as any job is held.
class job_dispatcher final : public std::enable_shared_from_this<job_dispatcher>, private shareable_queue {
  public:
    job_dispatcher(boost::asio::any_io_executor executor, pool_options options);
    job_dispatcher(const job_dispatcher&) = delete;
    job_dispatcher& operator=(const job_dispatcher&) = delete;
    ~job_dispatcher() = default;

    // -- on the service's executor ---------------------------------------------------------------------------------
    /// To be called first, once a shared_ptr owns this.
    void start();
    /// Queues a job, or refuses it. \param what is copied \param task its handler
    void submit(const request& what, responder answer, std::shared_ptr<const registration> task);
    [[nodiscard]] node_load load() const noexcept;
    [[nodiscard]] pool_figures figures() const;
    /// From now on, jobs that wait may move to other nodes. \param by made for `queue`
    void share(std::unique_ptr<job_sharing> by) { sharing_ = std::move(by); }
    [[nodiscard]] shareable_queue& queue() noexcept { return *this; }
    void drain(std::chrono::milliseconds limit, std::function<void(const drain_report&)> done);
    /// Returns how many threads are abandoned.
    std::size_t close(std::chrono::milliseconds limit);
    std::size_t close() { return close(close_timeout_); }
    /// A handler has run on this executor.
    void record_inline_call(std::string_view task, std::chrono::nanoseconds took);

    // -- from any thread -------------------------------------------------------------------------------------------
    struct shared_counts {
        std::atomic<std::uint64_t> threw{0};
        std::atomic<std::uint64_t> answerless{0};
        std::atomic<std::uint64_t> answered_twice{0};
        std::atomic<std::uint64_t> logs_dropped{0};
    };
    [[nodiscard]] shared_counts& counts() noexcept { return counts_; }
    [[nodiscard]] completion_queue& completions() noexcept { return completions_; }
    /// The service's; empty after `close`.
    [[nodiscard]] boost::asio::any_io_executor executor() const;
    /// The last reference to the record has been released.
    void return_record(job_record& r) noexcept;
    void delegate(job_ptr job, std::string command, call_options options, answer_callback answered);
    std::shared_ptr<detail::job_feed_control> bind(job_ptr job, std::string noun, bind_options options);
    void log(job_ptr job, log_level level, std::string text);

  private:
    /// Of a job, by its number.
    [[nodiscard]] job_status status_of(std::uint64_t number) const;
    job_record& acquire_record();
    void recycle(job_record& r);
    void end_burst_later();
    void refuse(responder& answer, worker_pool::admission why);

    void process_completions();
    void forget_requester(job_record& r);
    void release_record(job_record& r);
    /// Where a job was when it was stopped.
    enum class stopped_job : std::uint8_t {
        waiting, ///< it has ended
        moved,   ///< it has ended here, and its node is told to stop it
        started, ///< it has been told to stop
    };
    stopped_job stop(job_record& r);

    // shareable_queue
    [[nodiscard]] state read_state() const override;
    void offer(job_taker& to) override;
    void end_move(job_record& r, bool refused);
    void report_change();

    void on_timer();
    void arm_timer();
    void report_pause(std::chrono::nanoseconds lasted);
    void report_stuck();
    void fail_open_jobs(drain_report& report);
    void update_drain(bool at_limit);
    void write_log(log_level level, const log_entry& what) const;

    mutable adaptive_mutex executor_mutex_;
    boost::asio::any_io_executor executor_;
    pool_options options_;
    shared_counts counts_;
    completion_queue completions_;
    worker_pool workers_;
    pause_detector pauses_;
    delegated_requests delegated_;
    job_feeds feeds_;
    stop_notifier stop_notifier_;

    job_record_pool records_;
    std::size_t open_ = 0;                 // jobs whose requester has no answer yet
    std::size_t awaited_ = 0;              // of these, those that have not been told to stop
    std::size_t moved_ = 0;                // of these, those that other nodes run
    std::unique_ptr<job_sharing> sharing_; // null: jobs stay
    bool burst_end_posted_ = false;
    std::size_t unwoken_jobs_ = 0;
    std::vector<completion_queue::entry> entries_;
    std::vector<completion_queue::function> functions_;

    // These hold nothing of the executor after `close`, because its context may be destroyed then.
    boost::asio::any_io_executor work_guard_; // keeps it running while there are jobs
    std::optional<boost::asio::steady_timer> timer_;
    std::optional<boost::asio::steady_timer> drain_limit_;
    std::function<void(const drain_report&)> on_drained_; // null: it is not being drained
    bool timer_armed_ = false;
    bool timer_idle_ = false; // armed while there was no job

    std::atomic<bool> draining_{false};
    bool closed_ = false;
    std::chrono::milliseconds close_timeout_;

    pool_figures figures_; // those that are counted here
};

/// Runs the jobs of a service on workers.
///
/// A job is admitted to a bounded queue, or answered `busy` with `retry_ms`, an estimate of how long the queue will
/// take. Requesters (links) take turns, so one with many jobs does not delay the others. A job that is cancelled, whose
/// link is lost or whose deadline has passed is removed from the queue; if it is already running, it is notified to
/// stop. A job that does not stop then is stuck: it is reported, and its worker is replaced while there are
/// replacements.
///
/// All functions have to be called on the service's executor, and the pool has to be destroyed before its service. At
/// its end, jobs without an answer are answered `unavailable`. Threads that are still in a job or an `on_stop` callback
/// after `pool_options::close_timeout` are abandoned: such a program has to end with `std::_Exit` or `std::quick_exit`,
/// because there is no way to end a thread from outside.
class job_pool {
  public:
    job_pool(service& host, pool_options options);
    job_pool(const job_pool&) = delete;
    job_pool& operator=(const job_pool&) = delete;
    ~job_pool() { dispatcher_->close(); }

    /// For announcements and `any:`; cheap.
    [[nodiscard]] node_load load() const noexcept { return dispatcher_->load(); }
    [[nodiscard]] pool_figures figures() const { return dispatcher_->figures(); }

    /// Shares jobs with other nodes: those that wait may move there, and theirs to this pool (docs/sharing.md).
    void share(service& host) { dispatcher_->share(share_jobs(host, dispatcher_->queue())); }

    /// Admits no more jobs, and calls back when all have ended. At the limit it answers those that are left, tells
    /// those that run to stop, and calls back; after that the destructor waits for no job, and `close` only as long as
    /// its argument says. To be called once.
    void drain(std::chrono::milliseconds limit, std::function<void(const drain_report&)> done) {
        dispatcher_->drain(limit, std::move(done));
    }

    /// Does what the destructor does, with another limit than `pool_options::close_timeout`: answers what is left, and
    /// waits that long in total for workers and `on_stop` callbacks, and up to a second for those about to end. Returns
    /// how many threads are abandoned; 0 if the pool has been closed before.
    std::size_t close(std::chrono::milliseconds limit) { return dispatcher_->close(limit); }

    /// For `pooled_registrar`, whose handlers may be called after the pool has been destroyed.
    [[nodiscard]] const std::shared_ptr<job_dispatcher>& dispatcher() const noexcept { return dispatcher_; }

  private:
    std::shared_ptr<job_dispatcher> dispatcher_;
};

} // namespace cles::runtime
