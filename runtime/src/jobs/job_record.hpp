// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/error.hpp>
#include <cles/identity.hpp>
#include <cles/json_writer.hpp>
#include <cles/limits.hpp>
#include <cles/log.hpp>
#include <cles/owned_request.hpp>
#include <cles/registrar.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>

#include "jobs/adaptive_mutex.hpp"
#include "jobs/job_queue.hpp"
#include "jobs/job_times.hpp"
#include "jobs/stop_callback.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/smart_ptr/intrusive_ptr.hpp>
#include <boost/unordered/unordered_flat_map.hpp>

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

class job_dispatcher;

/// One job, from its admission until its last holder releases it; then the memory is reused for another job. It is what
/// the responder of its handler holds: a job answers once, on its worker or later, from any thread, even after the pool
/// has ended. A second answer is counted and ignored; one that comes after the requester withdrew is ignored.
///
/// Members are grouped by who may use them: any thread, the worker pool (under its mutex), the owner of the records, or
/// the service's executor (of which the owner of the records is a part).
class job_record final : public job_queue::item, public detail::call_control {
  public:
    // -- any thread ------------------------------------------------------------------------------------------------
    void add_reference() noexcept { references_.fetch_add(1, std::memory_order_relaxed); }
    /// The last release answers the job if it has not been answered, and returns the record.
    void release() noexcept;
    friend void intrusive_ptr_add_ref(job_record* r) noexcept { r->add_reference(); }
    friend void intrusive_ptr_release(job_record* r) noexcept { r->release(); }

    // The functions of a responder, which has checked and compacted the JSON.
    void done(std::string_view json) override { answer(json, std::nullopt, std::nullopt); }
    void fail(errc code, std::string_view message) override { answer(message, code, std::nullopt); }
    void refuse(std::string_view message, std::chrono::milliseconds retry) override {
        answer(message, errc::busy, retry);
    }
    bool progress(double fraction, std::string_view json) override;
    /// Calls back on a thread that only makes these calls; or at once, in this thread, if the job has been stopped. A
    /// later callback replaces an earlier one.
    void on_stop(std::function<void()> callback) override { on_stop_.set(std::move(callback)); }
    /// The job has been withdrawn, its link is lost, its time is over, or the pool ends.
    [[nodiscard]] bool stopped() const noexcept override { return on_stop_.stopped(); }
    /// No worker is held while the request waits: the callback runs on a worker as a continuation of this job. The
    /// start and the continuations of one job never run at the same time. If the pool ends first, the callback gets
    /// `unavailable`; it is dropped without a call only if no worker becomes free for it in time, because all that are
    /// left are in jobs that do not end. (If too many requests are made at once, it is called with `busy` before this
    /// function returns.)
    void delegate(std::string_view command, const call_options& options, answer_callback answered) override;
    /// No worker is held while the job waits for an event either: the callback is a continuation, too.
    std::shared_ptr<detail::job_feed_control> bind(detail::job_feed_maker make, std::string_view noun,
                                                   const bind_options& options) override;
    /// Entries that come too fast are dropped and counted.
    void log(log_level level, std::string_view text) override;
    [[nodiscard]] boost::asio::any_io_executor executor() const override;
    [[nodiscard]] bool is_thread_safe() const noexcept override { return true; }

    [[nodiscard]] const cles::request& request() const noexcept { return request_; }
    /// The greatest fraction that the handler has reported; nothing: none.
    [[nodiscard]] std::optional<double> reported() const noexcept {
        const auto fraction = reported_.load(std::memory_order_relaxed);
        return fraction > 0 ? std::optional{fraction} : std::nullopt;
    }
    /// The JSON or the message with which the job is answered, as far as it is known.
    [[nodiscard]] const std::string& result() const noexcept { return result_; }

    /// Runs the task's handler on a worker, unless the requester has withdrawn or the job's time is over. False if the
    /// executor, which would know of a withdrawal, is late (`executor_due` has passed): then nothing has been done.
    [[nodiscard]] bool start(time_point executor_due) noexcept;
    /// Runs a continuation of the job on a worker.
    void run(const std::function<void()>& continuation) noexcept;
    /// The worker is done with the job: sends the written result, if any, and releases the job. Returns whether there
    /// was a result. \param may_defer sends it without waking the executor
    bool finish_run(bool may_defer) noexcept;
    /// If it is traced, notes what it does from now on.
    void note_phase(job_times::phase next) {
        if (is_traced()) {
            times_.begin(next, time_point::clock::now());
        }
    }
    /// Identifies the job's task.
    [[nodiscard]] const void* task() const noexcept { return task_.get(); }

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
    /// What the job is about. \param peer a copy of the requester's identity \param task its handler
    void assign(const cles::request& what, std::shared_ptr<const identity> peer,
                std::shared_ptr<const registration> task);
    /// Releases what belonged to the job, except for some memory.
    void clear();
    /// Identifies the job among all of its pool; see `job_record_pool::find`.
    std::uint64_t number = 0;

  private:
    friend job_dispatcher;

    struct progress_report {
        double fraction;
        std::string json;
    };

    [[nodiscard]] bool is_traced() const noexcept { return !request_.trace().empty(); }
    template <class F>
    void run_guarded(F&& work) noexcept;
    [[nodiscard]] bool claim_answer() noexcept;
    void answer(std::string_view text, std::optional<errc> failure, std::optional<std::chrono::milliseconds> retry);
    void send_progress();
    void send_answer();
    void report_times();

    // -- any thread ------------------------------------------------------------------------------------------------
    std::atomic<int> references_{0};
    std::atomic<bool> answered_{false}; // the thread that sets it writes the result
    std::atomic<bool> progress_unwanted_{false};
    std::atomic<double> reported_{0}; // from 0 to 1
    stop_callback on_stop_;
    adaptive_mutex mutex_; // of the reports
    std::vector<progress_report> reports_;
    std::string result_;
    std::optional<errc> failure_;                    // then the result is its message
    std::optional<std::chrono::milliseconds> retry_; // of a refusal
    bool result_written_ = false;                    // used by the worker only
    job_times times_;                                // of a traced job
    detail::owned_request owned_;
    cles::request request_{owned_.data()};
    std::shared_ptr<job_dispatcher> dispatcher_;
    std::shared_ptr<const registration> task_;

    // -- the executor ----------------------------------------------------------------------------------------------
    std::optional<responder> requester_;
    std::uint64_t moved_ = 0; // the ticket of a job that another node runs; 0: it is here
    std::vector<progress_report> sent_reports_;
};

/// A holder of a job, which keeps it open: when the last one and the job's worker release it without an answer, it is
/// answered `failed`.
using job_ptr = boost::intrusive_ptr<job_record>;

/// The records of a pool's jobs: those in use, and some spare ones. Used on the service's executor.
class job_record_pool {
  public:
    /// A record for a new job, with one reference.
    job_record& acquire(std::shared_ptr<job_dispatcher> dispatcher);
    /// Takes back a record without references.
    void recycle(job_record& r);
    /// From now on the records in use destroy themselves.
    void close() noexcept;

    /// The record of a job; null if the job has ended, and the record may be that of another.
    [[nodiscard]] job_record* find(std::uint64_t number) const noexcept;
    /// The number of records in use.
    [[nodiscard]] std::size_t size() const noexcept { return slots_.size() - free_slots_.size(); }
    /// Calls `f` with each record in use, which it may recycle. It must not acquire one.
    template <class F>
    void for_each(F f) {
        for (const auto& each : slots_) {
            if (each.record) {
                f(*each.record);
            }
        }
    }

    /// A copy of a requester's identity. All jobs of one requester share it, and it may outlive the link.
    [[nodiscard]] std::shared_ptr<const identity> copy_of(const identity& peer);

  private:
    static constexpr std::size_t max_spare = 1024;
    static constexpr std::size_t max_spare_bytes = std::size_t{1} << 20U; // for results
    static constexpr std::size_t max_copies = 1024;

    struct slot {
        std::unique_ptr<job_record> record{}; // null: free
        std::uint32_t uses = 0;
    };

    std::vector<std::unique_ptr<job_record>> spare_;
    std::size_t spare_bytes_ = 0;
    std::vector<slot> slots_;
    std::vector<std::uint32_t> free_slots_;
    boost::unordered_flat_map<const identity*, std::shared_ptr<const identity>> copies_;
};

/// JSON text that is known to be valid and free of white space, as a result: it is written unchanged.
struct compact_json {
    std::string_view text;
};

} // namespace cles::runtime

template <>
struct cles::converter<cles::runtime::compact_json> {
    static void write(json_writer& w, const runtime::compact_json& value) { w.checked(value.text); }
};
