// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/limits.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>

#include "jobs/adaptive_mutex.hpp"
#include "jobs/job_context.hpp"
#include "jobs/job_queue.hpp"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::runtime {

class pending_replies;
class job_dispatcher;

/// One job, from its admission until its last holder releases it; then the memory is reused for another job.
///
/// Members are grouped by who may use them: any thread, the worker pool (under its mutex), the owner of the records, or
/// the service's executor (of which the owner of the records is a part).
class job_record final : public job_queue::item {
  public:
    job_record() = default;
    ~job_record() = default;

    // -- any thread ------------------------------------------------------------------------------------------------
    void add_reference() noexcept { references_.fetch_add(1, std::memory_order_relaxed); }
    /// The last release answers the job if it has not been answered, and returns the record.
    void release() noexcept;

    /// \param json compact, or empty; not checked again
    void done(std::string_view json);
    void fail(errc code, std::string_view message);
    void refuse(std::string_view message, std::chrono::milliseconds retry);
    /// \param json compact; not checked again
    bool progress(double fraction, std::string_view json);
    [[nodiscard]] bool wants_progress() const noexcept;
    void on_stop(std::function<void()> callback);
    void delegate(std::string_view command, const call_options& options, answer_callback answered);
    void log(log_level level, std::string_view text);
    [[nodiscard]] bool stopped() const noexcept { return stopped_.load(std::memory_order_acquire); }
    [[nodiscard]] const cles::request& request() const noexcept { return request_; }
    [[nodiscard]] boost::asio::any_io_executor executor() const;

    /// Where a worker that is the only holder of the job writes its result.
    std::string& result_buffer() noexcept { return result_; }
    /// The result has been written; `finish_run` sends it.
    void set_result_written() noexcept { result_written_ = true; }

    /// Runs the job's work on a worker, unless its requester has withdrawn or its time is over. False if the executor,
    /// which would know of a withdrawal, is late (`executor_due` has passed): then nothing has been done.
    [[nodiscard]] bool start(time_point executor_due) noexcept;
    /// Runs a continuation of the job on a worker.
    void run(const std::function<void()>& continuation) noexcept;
    /// The worker is done with the job: sends the written result, if any, and releases the job. Returns whether there
    /// was a result. \param may_defer sends it without waking the executor
    bool finish_run(bool may_defer) noexcept;
    /// Identifies the job's task.
    [[nodiscard]] const void* task() const noexcept { return work_.get(); }

    /// The job that this thread runs: whether its result may be deferred, and whether it has been.
    struct current_run {
        const job_record* job = nullptr;
        bool may_defer = false;
        bool deferred = false;
    };
    static void set_current_run(current_run* run) noexcept;

    // -- the worker pool -------------------------------------------------------------------------------------------
    enum class run_state : std::uint8_t { idle, queued, running };
    run_state state = run_state::idle;
    bool started = false;
    std::size_t worker_slot = 0;                        ///< of the worker that runs it
    std::vector<std::function<void()>> continuations{}; ///< to run at its next turn

    // -- the owner of the records ----------------------------------------------------------------------------------
    /// Prepares the record for a new job, with one reference.
    void open(std::shared_ptr<job_dispatcher> dispatcher);
    /// Releases what belonged to the job, except for some memory.
    void clear();
    std::size_t index = 0; ///< among the records in use

  private:
    friend pending_replies;
    friend job_dispatcher;

    struct progress_report {
        double fraction;
        std::string json;
    };

    void fail(const std::exception_ptr& thrown);
    [[nodiscard]] bool claim_answer() noexcept;
    void drop_on_stop() noexcept;
    void post_answer() noexcept;

    // -- any thread ------------------------------------------------------------------------------------------------
    std::atomic<int> references_{0};
    std::atomic<bool> answered_{false}; // the thread that sets it writes the result
    std::atomic<bool> stopped_{false};
    std::atomic<bool> progress_unwanted_{false};
    std::atomic<bool> has_on_stop_{false};
    adaptive_mutex mutex_; // of the next two
    std::vector<progress_report> reports_;
    std::function<void()> on_stop_;
    std::string result_;
    std::optional<errc> failure_;                    // then the result is its message
    std::optional<std::chrono::milliseconds> retry_; // of a refusal
    bool result_written_ = false;                    // used by the worker only
    detail::owned_request owned_;
    cles::request request_{owned_.data()};
    std::shared_ptr<job_dispatcher> dispatcher_;
    std::shared_ptr<const job_work> work_;

    // -- the executor ----------------------------------------------------------------------------------------------
    std::optional<responder> requester_;
    bool awaited_ = false; // neither answered nor stopped
};

} // namespace cles::runtime
