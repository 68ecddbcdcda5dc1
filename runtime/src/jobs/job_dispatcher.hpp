// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/peer.hpp>

#include "jobs/completion_queue.hpp"
#include "jobs/delegated_requests.hpp"
#include "jobs/job_pool.hpp"
#include "jobs/job_record.hpp"
#include "jobs/owned_request.hpp"
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

/// The wait for the last jobs of a pool: it ends once, by the last job or by the limit.
class draining {
  public:
    explicit draining(const boost::asio::any_io_executor& executor) : limit_(std::in_place, executor) {}

    /// \param at_limit called unless `end` or `forget` was before
    void begin(std::chrono::milliseconds limit, std::function<void()> at_limit,
               std::function<void(const drain_report&)> done);
    [[nodiscard]] bool under_way() const noexcept { return done_ != nullptr; }
    void end(const drain_report& how);
    /// Nobody waits any more; nothing of the executor is held from here on.
    void forget();

  private:
    std::optional<boost::asio::steady_timer> limit_;
    std::function<void(const drain_report&)> done_;
};

/// The inside of a pool: what happens on the service's executor, one step from a job's admission to its end after the
/// other. What the steps need is kept by its parts. It lives as long as a job that somebody holds.
class pool_state final : public std::enable_shared_from_this<pool_state> {
  public:
    pool_state(boost::asio::any_io_executor executor, pool_options options);
    pool_state(const pool_state&) = delete;
    pool_state& operator=(const pool_state&) = delete;
    ~pool_state();

    // -- on the service's executor ---------------------------------------------------------------------------------
    /// To be called first, when it is owned.
    void start();
    void submit(job what);
    [[nodiscard]] node_load load() const noexcept;
    [[nodiscard]] pool_figures figures() const;
    void drain(std::chrono::milliseconds limit, std::function<void(const drain_report&)> done);
    /// Returns how many threads are left behind.
    std::size_t close(std::chrono::milliseconds limit);
    std::size_t close() { return close(patience_); }
    /// A handler ran on this executor for so long.
    void note_inline(std::string_view task, std::chrono::nanoseconds took);

    // -- from any thread -------------------------------------------------------------------------------------------
    struct shared_counts {
        std::atomic<std::uint64_t> threw{0};
        std::atomic<std::uint64_t> answerless{0};
        std::atomic<std::uint64_t> answered_twice{0};
        std::atomic<std::uint64_t> logs_dropped{0};
    };
    [[nodiscard]] shared_counts& counts() noexcept { return counts_; }
    [[nodiscard]] result_box& box() noexcept { return box_; }
    /// The service's; empty after the end.
    [[nodiscard]] boost::asio::any_io_executor executor() const;
    /// Nobody holds it any more.
    void give_back(job_record& r) noexcept;
    void delegate(job_context asks, std::string command, call_options options, answer_callback answered);
    void log(job_context says, log_level level, std::string text);

  private:
    job_record& take_record();
    void recycle(job_record& r);
    void wake_workers();
    void refuse(responder& answer, worker_pool::admission why);

    void collect();
    void let_go(job_record& r);
    void stop(job_record& r);

    void tick();
    void arm_tick();
    void expect_tick(time_point now);
    void notice_pause();
    void look_for_pause();
    void read_on();
    void begin_again();
    void report_stuck();
    void abandon(drain_report& report);
    void follow_drain(bool over);
    void say(log_level level, const log_entry& what) const;

    mutable brief_mutex executor_mutex_;
    boost::asio::any_io_executor executor_;
    pool_options options_;
    shared_counts counts_;
    result_box box_;
    worker_pool workers_;
    onward_requests onward_;
    stop_notifier stop_notifier_;

    job_records records_;
    open_answers answers_;
    kept_peers peers_;
    bool wake_asked_ = false;
    std::size_t unwoken_ = 0;
    std::vector<result_box::item> items_;
    std::vector<result_box::errand> errands_;

    // These three hold nothing of the executor after the end, for the context may go then.
    boost::asio::any_io_executor busy_; // keeps it at work while there are jobs
    std::optional<boost::asio::steady_timer> tick_;
    draining drain_;
    bool ticking_ = false;
    bool idle_tick_ = false; // set while there was no job
    std::chrono::milliseconds tick_span_{0};

    // While what came during a pause is read.
    bool reading_ = false;
    time_point reading_since_;
    unsigned quiet_rounds_ = 0;
    std::uint64_t changes_ = 0; // jobs that came and were stopped, so far
    std::uint64_t changes_before_ = 0;

    std::atomic<bool> draining_{false};
    bool closed_ = false;
    std::chrono::milliseconds patience_;

    pool_figures figures_; // of which it keeps those that are its own
};

} // namespace cles::runtime
