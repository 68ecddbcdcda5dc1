// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_record.hpp"

#include "jobs/current_trace.hpp"
#include "jobs/job_pool.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
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
    progress_unwanted_.store(false, std::memory_order_relaxed);
    reported_.store(0, std::memory_order_relaxed);
    result_written_ = started = false;
}

void job_record::assign(const cles::request& what, std::shared_ptr<const identity> peer,
                        std::shared_ptr<const registration> task) {
    requester = reinterpret_cast<std::uintptr_t>(&what.peer());
    owned_.assign(what, std::move(peer));
    task_ = std::move(task);
}

void job_record::clear() {
    if (is_traced()) {
        times_.reset();
    }
    dispatcher_.reset();
    task_.reset();
    reports_.clear();
    on_stop_.reset();
    failure_.reset();
    retry_.reset();
    result_.clear();
    if (result_.capacity() > max_retained_result) {
        result_ = {};
    }
    owned_.clear();
}

// A number consists of a slot, and how often the slot has been used.
job_record& job_record_pool::acquire(std::shared_ptr<job_dispatcher> dispatcher) {
    if (free_slots_.empty()) {
        free_slots_.push_back(static_cast<std::uint32_t>(slots_.size()));
        slots_.emplace_back();
    }
    std::unique_ptr<job_record> taken;
    if (spare_.empty()) {
        taken = std::make_unique<job_record>();
    } else {
        taken = std::move(spare_.back());
        spare_.pop_back();
        spare_bytes_ -= taken->result().capacity();
    }
    const auto at = free_slots_.back();
    auto& place = slots_[at];
    place.record = std::move(taken);
    auto& r = *place.record;
    r.open(std::move(dispatcher));
    r.number = std::uint64_t{++place.uses} << 32U | at;
    free_slots_.pop_back();
    return r;
}

job_record* job_record_pool::find(std::uint64_t number) const noexcept {
    const auto at = static_cast<std::uint32_t>(number);
    auto* const r = at < slots_.size() ? slots_[at].record.get() : nullptr;
    return r != nullptr && r->number == number ? r : nullptr;
}

void job_record_pool::recycle(job_record& r) {
    const auto at = static_cast<std::uint32_t>(r.number);
    auto owned = std::move(slots_[at].record);
    free_slots_.push_back(at);
    r.clear(); // the dispatcher, which runs, outlives this
    const auto bytes = spare_bytes_ + r.result().capacity();
    if (spare_.size() < max_spare && bytes <= max_spare_bytes) {
        spare_bytes_ = bytes;
        spare_.push_back(std::move(owned));
    }
}

void job_record_pool::close() noexcept {
    for (auto& each : slots_) {
        static_cast<void>(each.record.release()); // destroys itself
    }
    slots_.clear();
    free_slots_.clear();
    spare_.clear();
    spare_bytes_ = 0;
}

std::shared_ptr<const identity> job_record_pool::copy_of(const identity& peer) {
    if (copies_.size() > max_copies) {
        copies_.clear();
    }
    auto& copy = copies_[&peer];
    if (!copy || *copy != peer) { // another link may be at the address of an earlier one
        copy = std::make_shared<identity>(peer);
    }
    return copy;
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
    if (is_traced()) {
        times_.freeze(time_point::clock::now());
    }
    on_stop_.drop(); // here, on the job's thread, and not on the executor
    return true;
}

void job_record::answer(std::string_view text, std::optional<errc> failure,
                        std::optional<std::chrono::milliseconds> retry) {
    if (!claim_answer()) {
        return;
    }
    result_ = text;
    failure_ = failure;
    retry_ = retry;
    const bool defer = current != nullptr && current->job == this && current->may_defer;
    if (defer) {
        current->deferred = true;
    }
    add_reference();
    if (!dispatcher_->completions().push({this, completion_queue::event::answered}, defer)) {
        release();
    }
}

// On the executor.
void job_record::report_times() {
    if (is_traced() && requester_) {
        const auto times = times_.take(time_point::clock::now());
        requester_->record_times(times.queued, times.ran);
    }
}

void job_record::send_answer() {
    report_times();
    if (retry_) {
        requester_->refuse(result_, *retry_);
    } else if (failure_) {
        requester_->fail(*failure_, result_);
    } else if (result_.empty()) {
        requester_->done();
    } else {
        requester_->done(compact_json{result_});
    }
}

// -- progress ------------------------------------------------------------------------------------------------------

bool job_record::progress(double fraction, std::string_view json) {
    if (stopped() || answered_.load(std::memory_order_relaxed)) {
        return false;
    }
    if (std::isnan(fraction)) {
        fraction = 0;
    }
    // Listed with the job, also if the requester wants no reports.
    reported_.store(std::clamp(fraction, reported_.load(std::memory_order_relaxed), 1.0), std::memory_order_relaxed);
    if (progress_unwanted_.load(std::memory_order_relaxed)) {
        return false;
    }
    std::string details{json};
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

void job_record::send_progress() {
    {
        const std::lock_guard lock{mutex_};
        sent_reports_.swap(reports_);
    }
    for (const auto& each : sent_reports_) {
        if (!requester_ || !requester_->progress(each.fraction, compact_json{each.json})) {
            progress_unwanted_.store(true, std::memory_order_relaxed);
            break;
        }
    }
    sent_reports_.clear();
}

// -- the rest of a responder's functions ---------------------------------------------------------------------------

void job_record::delegate(std::string_view command, const call_options& options, answer_callback answered) {
    dispatcher_->delegate(job_ptr{this}, std::string{command}, options, std::move(answered));
}

std::shared_ptr<detail::job_feed_control> job_record::bind(detail::job_feed_maker /*make*/, std::string_view noun,
                                                           const bind_options& options) {
    return dispatcher_->bind(job_ptr{this}, std::string{noun}, options);
}

void job_record::log(log_level level, std::string_view text) {
    dispatcher_->log(job_ptr{this}, level, std::string{text.substr(0, max_log_length)});
}

boost::asio::any_io_executor job_record::executor() const { return dispatcher_->executor(); }

// -- work ----------------------------------------------------------------------------------------------------------

// An exception becomes text on this thread, because it belongs to the code that threw it.
template <class F>
void job_record::run_guarded(F&& work) noexcept {
    const current_trace during{request_.trace()};
    note_phase(job_times::phase::running);
    try {
        work();
    } catch (...) {
        dispatcher_->counts().threw.fetch_add(1, std::memory_order_relaxed);
        detail::fail_with(*this, std::current_exception());
    }
    note_phase(job_times::phase::elsewhere);
}

bool job_record::start(time_point executor_due) noexcept {
    const auto now = time_point::clock::now();
    const bool over = request_.deadline() != time_point{} && request_.deadline() <= now;
    if (!stopped() && !over && now > executor_due) {
        return false;
    }
    run_guarded([&] {
        if (stopped()) { // while a worker took it from the queue
            fail(errc::cancelled, "the requester no longer waits for it");
        } else if (over) {
            fail(errc::deadline, "its deadline had passed before it began");
        } else if (task_->plain) {
            json_writer writer{result_};
            detail::run_plain(task_->plain, request_, writer);
            result_written_ = true;
        } else {
            add_reference();
            task_->async(request_,
                         responder{std::shared_ptr<detail::call_control>{this, [](job_record* r) { r->release(); }}});
        }
    });
    return true;
}

void job_record::run(const std::function<void()>& continuation) noexcept { run_guarded(continuation); }

} // namespace cles::runtime
