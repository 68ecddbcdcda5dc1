// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/limits.hpp>
#include <cles/responder.hpp>

#include "jobs/adaptive_mutex.hpp"
#include "jobs/job_context.hpp"
#include "jobs/job_queue.hpp"
#include "jobs/owned_request.hpp"

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

class open_answers;
class pool_state;

/// One job from its admission until nobody holds it any more; then its memory serves for another.
///
/// Each member belongs to one of four: the service's executor, of which what keeps the records has a part, the worker
/// pool (under its mutex), or everybody.
class job_record final : public job_queue::item {
  public:
    job_record() = default;
    ~job_record() = default;

    // -- everybody's -----------------------------------------------------------------------------------------------
    void add_reference() noexcept { references_.fetch_add(1, std::memory_order_relaxed); }
    /// When the last one goes, the job is answered where it has not been, and given back.
    void release() noexcept;

    void done(std::string_view json);
    void fail(errc code, std::string_view message);
    void refuse(std::string_view message, std::chrono::milliseconds retry);
    bool progress(double fraction, std::string_view json);
    void on_stop(std::function<void()> callback);
    void delegate(std::string_view command, const call_options& options, answer_callback answered);
    void log(log_level level, std::string_view text);
    [[nodiscard]] bool stopped() const noexcept { return stopped_.load(std::memory_order_acquire); }
    [[nodiscard]] const cles::request& request() const noexcept { return request_.get(); }
    [[nodiscard]] boost::asio::any_io_executor executor() const;

    /// Where the worker that is alone with the job writes its result.
    std::string& result_text() noexcept { return result_; }
    /// It has written it, and will settle.
    void set_written() noexcept { written_ = true; }

    /// Runs the job's beginning on a worker, unless nobody waits for it any more or its time is over. False where the
    /// executor, which would know of a withdrawal, was to be back by a time that has passed: then nothing has been
    /// done.
    [[nodiscard]] bool begin(time_point listening_until) noexcept;
    /// Runs a part of it that was called back, on a worker.
    void run(const std::function<void()>& part) noexcept;
    /// The worker has let go of everything else: it answers where it has written, and lets go of the job. True where
    /// there was a result, which `may_keep` has fetched when the executor comes by.
    bool settle(bool may_keep) noexcept;
    /// What the job's task is told apart by.
    [[nodiscard]] const void* task() const noexcept { return work_.get(); }

    /// Whether this thread, which is at a job, may keep its result back; and whether it has.
    struct at_work {
        const job_record* job = nullptr;
        bool may_keep = false;
        bool kept = false;
    };
    static void set_at_work(at_work* record) noexcept;

    // -- the worker pool's -----------------------------------------------------------------------------------------
    enum class place : std::uint8_t { nowhere, queued, at_work };
    place where = place::nowhere;
    bool begun = false;
    std::size_t worker = 0;                           ///< where it is at work
    std::vector<std::function<void()>> called_back{}; ///< to be run when it is its turn

    // -- of what keeps the records ---------------------------------------------------------------------------------
    /// It serves for a new job, with one reference.
    void open(std::shared_ptr<pool_state> pool);
    /// Lets go of all that belonged to its job, but for some memory.
    void clear();
    std::size_t index = 0; ///< among those in use

  private:
    friend open_answers;
    friend pool_state;

    struct report {
        double fraction;
        std::string json;
    };

    void fail(const std::exception_ptr& thrown);
    [[nodiscard]] bool claim() noexcept;
    void forget_on_stop() noexcept;
    void publish() noexcept;

    // -- everybody's -----------------------------------------------------------------------------------------------
    std::atomic<int> references_{0};
    std::atomic<bool> answered_{false}; // the thread that sets it writes the result
    std::atomic<bool> stopped_{false};
    std::atomic<bool> unheard_{false}; // nobody wants its progress
    std::atomic<bool> listens_{false}; // to be told that it is stopped
    brief_mutex mutex_;                // of the next two
    std::vector<report> reports_;
    std::function<void()> on_stop_;
    std::string result_;
    std::optional<errc> failure_;                    // then the result is its message
    std::optional<std::chrono::milliseconds> retry_; // of a job that refuses
    bool written_ = false;                           // the worker's own
    kept_request request_;
    std::shared_ptr<pool_state> pool_;
    std::shared_ptr<const job_work> work_;

    // -- the executor's --------------------------------------------------------------------------------------------
    std::optional<responder> answer_;
    bool awaited_ = false; // neither answered nor stopped
};

/// The records of a pool's jobs: those in use, and some that wait to be used again. On the service's executor.
class job_records {
  public:
    job_records() = default;
    job_records(const job_records&) = delete;
    job_records& operator=(const job_records&) = delete;
    ~job_records() = default;

    /// One for a new job, with one reference.
    job_record& take(std::shared_ptr<pool_state> pool);
    /// Nobody holds it any more.
    void recycle(job_record& r);
    /// From now on each ends itself.
    void disown() noexcept { in_use_.clear(); }
    void drop_spare() noexcept { spare_.clear(); }

    /// Those in use, in no order; what is recycled leaves its place to another.
    [[nodiscard]] std::size_t size() const noexcept { return in_use_.size(); }
    [[nodiscard]] job_record& operator[](std::size_t index) const noexcept { return *in_use_[index]; }

  private:
    std::vector<std::unique_ptr<job_record>> spare_;
    std::vector<job_record*> in_use_; // owned; each knows its place here
};

} // namespace cles::runtime
