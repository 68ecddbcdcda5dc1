// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_record.hpp"

#include "jobs/job_dispatcher.hpp"

#include <cmath>
#include <mutex>
#include <utility>

namespace cles::runtime {
namespace {

// Progress reports that wait for the executor; beyond that the newest replaces the one before it.
constexpr std::size_t max_reports = 16;
constexpr std::size_t max_log_length = 4096;
constexpr std::size_t max_retained_result = 65536;

thread_local job_record::current_run* current = nullptr;

} // namespace

// -- memory --------------------------------------------------------------------------------------------------------

void job_record::open(std::shared_ptr<job_dispatcher> dispatcher) {
    dispatcher_ = std::move(dispatcher);
    references_.store(1, std::memory_order_relaxed);
    answered_.store(false, std::memory_order_relaxed);
    stopped_.store(false, std::memory_order_relaxed);
    progress_unwanted_.store(false, std::memory_order_relaxed);
    has_on_stop_.store(false, std::memory_order_relaxed);
    result_written_ = started = awaited_ = false;
}

void job_record::clear() {
    dispatcher_.reset();
    work_.reset();
    reports_.clear();
    on_stop_ = nullptr;
    failure_.reset();
    retry_.reset();
    result_.clear();
    if (result_.capacity() > max_retained_result) {
        result_ = {};
    }
    owned_.clear();
}

// -- references ----------------------------------------------------------------------------------------------------

void job_record::release() noexcept {
    if (references_.fetch_sub(1, std::memory_order_acq_rel) != 1) {
        return;
    }
    if (!answered_.exchange(true)) { // it cannot be answered any more
        references_.store(1, std::memory_order_relaxed);
        failure_ = errc::failed;
        result_ = "the job ended without an answer";
        dispatcher_->counts().answerless.fetch_add(1, std::memory_order_relaxed);
        if (dispatcher_->completions().push({this, completion_queue::event::answered})) {
            return;
        }
        references_.store(0, std::memory_order_relaxed);
    }
    dispatcher_->return_record(*this);
}

bool job_record::finish_run(bool may_defer) noexcept {
    if (!result_written_) {
        release();
        return false;
    }
    // The queue takes over the reference.
    if (!claim_answer() || !dispatcher_->completions().push({this, completion_queue::event::answered}, may_defer)) {
        release();
    }
    return true;
}

void job_record::set_current_run(current_run* run) noexcept { current = run; }

// -- answers -------------------------------------------------------------------------------------------------------

bool job_record::claim_answer() noexcept {
    if (answered_.exchange(true)) {
        dispatcher_->counts().answered_twice.fetch_add(1, std::memory_order_relaxed);
        return false;
    }
    if (has_on_stop_.load(std::memory_order_acquire)) {
        drop_on_stop();
    }
    return true;
}

// A job that has answered is not told to stop any more. Its callback is destroyed here, on the job's thread, and not on
// the executor.
void job_record::drop_on_stop() noexcept {
    std::function<void()> dropped;
    const std::lock_guard lock{mutex_};
    dropped.swap(on_stop_);
}

void job_record::post_answer() noexcept {
    const bool defer = current != nullptr && current->job == this && current->may_defer;
    if (defer) {
        current->deferred = true;
    }
    add_reference();
    if (!dispatcher_->completions().push({this, completion_queue::event::answered}, defer)) {
        release();
    }
}

void job_record::done(std::string_view json) {
    if (!claim_answer()) {
        return;
    }
    result_ = json;
    post_answer();
}

void job_record::fail(errc code, std::string_view message) {
    if (!claim_answer()) {
        return;
    }
    result_ = message;
    failure_ = code;
    post_answer();
}

void job_record::refuse(std::string_view message, std::chrono::milliseconds retry) {
    if (!claim_answer()) {
        return;
    }
    result_ = message;
    failure_ = errc::busy;
    retry_ = retry;
    post_answer();
}

void job_record::fail(const std::exception_ptr& thrown) {
    add_reference();
    job_context{*this}.fail(thrown);
}

bool job_record::wants_progress() const noexcept {
    return !stopped() && !answered_.load(std::memory_order_relaxed) &&
           !progress_unwanted_.load(std::memory_order_relaxed);
}

bool job_record::progress(double fraction, std::string_view json) {
    if (!wants_progress()) {
        return false;
    }
    std::string details{json};
    if (std::isnan(fraction)) {
        fraction = 0;
    }
    {
        const std::lock_guard lock{mutex_};
        if (reports_.size() >= max_reports) {
            reports_.back() = {fraction, std::move(details)};
            return true;
        }
        reports_.push_back({fraction, std::move(details)});
        if (reports_.size() != 1) {
            return true; // an earlier one is being delivered
        }
    }
    add_reference();
    if (!dispatcher_->completions().push({this, completion_queue::event::progress})) {
        release();
        return false;
    }
    return true;
}

// -- the rest of the context ---------------------------------------------------------------------------------------

void job_record::on_stop(std::function<void()> callback) {
    {
        const std::lock_guard lock{mutex_};
        if (!stopped()) {
            on_stop_.swap(callback);
            has_on_stop_.store(true, std::memory_order_release);
            return;
        }
    }
    if (callback) {
        callback();
    }
}

void job_record::delegate(std::string_view command, const call_options& options, answer_callback answered) {
    add_reference();
    dispatcher_->delegate(job_context{*this}, std::string{command}, options, std::move(answered));
}

void job_record::log(log_level level, std::string_view text) {
    add_reference();
    dispatcher_->log(job_context{*this}, level, std::string{text.substr(0, max_log_length)});
}

boost::asio::any_io_executor job_record::executor() const { return dispatcher_->executor(); }

// -- work ----------------------------------------------------------------------------------------------------------

bool job_record::start(time_point executor_due) noexcept {
    try {
        const auto now = time_point::clock::now();
        if (stopped()) { // while a worker took it from the queue
            fail(errc::cancelled, "the requester does not wait for it any more");
            return true;
        }
        if (const auto due = request().deadline(); due != time_point{} && due <= now) {
            fail(errc::deadline, "its deadline had passed before it began");
            return true;
        }
        if (now > executor_due) {
            return false;
        }
        // The context borrows the worker's reference.
        struct borrowed {
            job_context context;
            ~borrowed() { context.record_ = nullptr; }
        };
        const borrowed job{job_context{*this}};
        (*work_)(job.context);
    } catch (...) {
        dispatcher_->counts().threw.fetch_add(1, std::memory_order_relaxed);
        fail(std::current_exception());
    }
    return true;
}

void job_record::run(const std::function<void()>& continuation) noexcept {
    try {
        continuation();
    } catch (...) {
        dispatcher_->counts().threw.fetch_add(1, std::memory_order_relaxed);
        fail(std::current_exception());
    }
}

} // namespace cles::runtime
