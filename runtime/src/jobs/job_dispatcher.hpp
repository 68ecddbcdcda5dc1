// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/peer.hpp>

#include "jobs/completion_queue.hpp"
#include "jobs/delegated_requests.hpp"
#include "jobs/drain_operation.hpp"
#include "jobs/identity_cache.hpp"
#include "jobs/job_pool.hpp"
#include "jobs/job_record.hpp"
#include "jobs/job_record_pool.hpp"
#include "jobs/pause_detector.hpp"
#include "jobs/pending_replies.hpp"
#include "jobs/stop_notifier.hpp"
#include "jobs/worker_pool.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/steady_timer.hpp>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::runtime {

/// Takes jobs through a pool, on the service's executor, from admission to reply: it is the sequence of these steps,
/// and its parts keep their state. It lives as long as any job is held.
class job_dispatcher final : public std::enable_shared_from_this<job_dispatcher> {
  public:
    job_dispatcher(boost::asio::any_io_executor executor, pool_options options);
    job_dispatcher(const job_dispatcher&) = delete;
    job_dispatcher& operator=(const job_dispatcher&) = delete;
    ~job_dispatcher();

    // -- on the service's executor ---------------------------------------------------------------------------------
    /// To be called first, once a shared_ptr owns this.
    void start();
    void submit(job what);
    [[nodiscard]] node_load load() const noexcept;
    [[nodiscard]] pool_figures figures() const;
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
    void delegate(job_context job, std::string command, call_options options, answer_callback answered);
    void log(job_context job, log_level level, std::string text);

  private:
    job_record& acquire_record();
    void recycle(job_record& r);
    void wake_workers();
    void refuse(responder& answer, worker_pool::admission why);

    void process_completions();
    void release_record(job_record& r);
    void stop(job_record& r);

    void on_timer();
    void arm_timer();
    void report_pause(std::chrono::nanoseconds lasted);
    void report_stuck();
    void fail_open_jobs(drain_report& report);
    void update_drain(bool over);
    void write_log(log_level level, const log_entry& what) const;

    mutable adaptive_mutex executor_mutex_;
    boost::asio::any_io_executor executor_;
    pool_options options_;
    shared_counts counts_;
    completion_queue completions_;
    worker_pool workers_;
    pause_detector pauses_;
    delegated_requests delegated_;
    stop_notifier stop_notifier_;

    job_record_pool records_;
    pending_replies replies_;
    identity_cache identities_;
    bool wake_posted_ = false;
    std::size_t unwoken_jobs_ = 0;
    std::vector<completion_queue::entry> entries_;
    std::vector<completion_queue::function> functions_;

    // These three hold nothing of the executor after `close`, because its context may be destroyed then.
    boost::asio::any_io_executor work_guard_; // keeps it running while there are jobs
    std::optional<boost::asio::steady_timer> timer_;
    drain_operation drain_;
    bool timer_armed_ = false;
    bool timer_idle_ = false; // armed while there was no job

    std::atomic<bool> draining_{false};
    bool closed_ = false;
    std::chrono::milliseconds close_timeout_;

    pool_figures figures_; // those that are counted here
};

} // namespace cles::runtime
