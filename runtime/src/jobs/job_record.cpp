// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_record.hpp"

#include "jobs/job_dispatcher.hpp"

#include <cmath>
#include <mutex>
#include <utility>

namespace cles::runtime {
namespace {

// Reports of progress that wait for the executor, past which the newest replaces the one before it.
constexpr std::size_t most_reports = 16;
constexpr std::size_t longest_log = 4096;
constexpr std::size_t roomy_result = 65536;

thread_local job_record::at_work* here = nullptr;

} // namespace

// -- its memory ----------------------------------------------------------------------------------------------------

void job_record::open(std::shared_ptr<pool_state> pool) {
    pool_ = std::move(pool);
    references_.store(1, std::memory_order_relaxed);
    answered_.store(false, std::memory_order_relaxed);
    stopped_.store(false, std::memory_order_relaxed);
    unheard_.store(false, std::memory_order_relaxed);
    listens_.store(false, std::memory_order_relaxed);
    written_ = begun = awaited_ = false;
}

void job_record::clear() {
    pool_.reset();
    work_.reset();
    reports_.clear();
    on_stop_ = nullptr;
    failure_.reset();
    retry_.reset();
    result_.clear();
    if (result_.capacity() > roomy_result) {
        result_ = {};
    }
    request_.clear();
}

// -- references ----------------------------------------------------------------------------------------------------

void job_record::release() noexcept {
    if (references_.fetch_sub(1, std::memory_order_acq_rel) != 1) {
        return;
    }
    if (!answered_.exchange(true)) { // nobody is left who could answer
        references_.store(1, std::memory_order_relaxed);
        failure_ = errc::failed;
        result_ = "the job ended without an answer";
        pool_->counts().answerless.fetch_add(1, std::memory_order_relaxed);
        if (pool_->box().put({this, result_box::news::ended})) {
            return;
        }
        references_.store(0, std::memory_order_relaxed);
    }
    pool_->give_back(*this);
}

bool job_record::settle(bool may_keep) noexcept {
    if (!written_) {
        release();
        return false;
    }
    // The box takes over the reference.
    if (!claim() || !pool_->box().put({this, result_box::news::ended}, may_keep)) {
        release();
    }
    return true;
}

void job_record::set_at_work(at_work* record) noexcept { here = record; }

// -- answers -------------------------------------------------------------------------------------------------------

bool job_record::claim() noexcept {
    if (answered_.exchange(true)) {
        pool_->counts().answered_twice.fetch_add(1, std::memory_order_relaxed);
        return false;
    }
    if (listens_.load(std::memory_order_acquire)) {
        forget_on_stop();
    }
    return true;
}

// A job that has answered is not told any more, and what it left for that goes here, where the job is at home, rather
// than on the executor.
void job_record::forget_on_stop() noexcept {
    std::function<void()> dropped;
    const std::lock_guard lock{mutex_};
    dropped.swap(on_stop_);
}

void job_record::publish() noexcept {
    const bool keep = here != nullptr && here->job == this && here->may_keep;
    if (keep) {
        here->kept = true;
    }
    add_reference();
    if (!pool_->box().put({this, result_box::news::ended}, keep)) {
        release();
    }
}

void job_record::done(std::string_view json) {
    if (!claim()) {
        return;
    }
    try {
        if (!json.empty()) {
            json_writer writer{result_};
            detail::write_text(writer, json);
        }
    } catch (const error& e) {
        result_ = e.message();
        failure_ = errc::failed;
    }
    publish();
}

void job_record::fail(errc code, std::string_view message) {
    if (!claim()) {
        return;
    }
    result_ = message;
    failure_ = code;
    publish();
}

void job_record::refuse(std::string_view message, std::chrono::milliseconds retry) {
    if (!claim()) {
        return;
    }
    result_ = message;
    failure_ = errc::busy;
    retry_ = retry;
    publish();
}

void job_record::fail(const std::exception_ptr& thrown) {
    add_reference();
    job_context{*this}.fail(thrown);
}

bool job_record::progress(double fraction, std::string_view json) {
    if (stopped() || answered_.load(std::memory_order_relaxed) || unheard_.load(std::memory_order_relaxed)) {
        return false;
    }
    std::string details;
    json_writer writer{details};
    detail::write_text(writer, json.empty() ? "{}" : json);
    if (std::isnan(fraction)) {
        fraction = 0;
    }
    {
        const std::lock_guard lock{mutex_};
        if (reports_.size() >= most_reports) {
            reports_.back() = {fraction, std::move(details)};
            return true;
        }
        reports_.push_back({fraction, std::move(details)});
        if (reports_.size() != 1) {
            return true; // the one before is on its way
        }
    }
    add_reference();
    if (!pool_->box().put({this, result_box::news::progress})) {
        release();
        return false;
    }
    return true;
}

// -- the rest of the world -----------------------------------------------------------------------------------------

void job_record::on_stop(std::function<void()> callback) {
    {
        const std::lock_guard lock{mutex_};
        if (!stopped()) {
            on_stop_.swap(callback);
            listens_.store(true, std::memory_order_release);
            return;
        }
    }
    if (callback) {
        callback();
    }
}

void job_record::delegate(std::string_view command, const call_options& options, answer_callback answered) {
    add_reference();
    pool_->delegate(job_context{*this}, std::string{command}, options, std::move(answered));
}

void job_record::log(log_level level, std::string_view text) {
    add_reference();
    pool_->log(job_context{*this}, level, std::string{text.substr(0, longest_log)});
}

boost::asio::any_io_executor job_record::executor() const { return pool_->executor(); }

// -- work ----------------------------------------------------------------------------------------------------------

bool job_record::begin(time_point listening_until) noexcept {
    try {
        const auto now = time_point::clock::now();
        if (stopped()) { // while its worker took it
            fail(errc::cancelled, "nobody waits for it any more");
            return true;
        }
        if (const auto due = request().deadline(); due != time_point{} && due <= now) {
            fail(errc::deadline, "its time was over before it began");
            return true;
        }
        if (now > listening_until) {
            return false;
        }
        // It borrows the worker's reference.
        struct lent {
            job_context context;
            ~lent() { context.record_ = nullptr; }
        };
        const lent to{job_context{*this}};
        (*work_)(to.context);
    } catch (...) {
        pool_->counts().threw.fetch_add(1, std::memory_order_relaxed);
        fail(std::current_exception());
    }
    return true;
}

void job_record::run(const std::function<void()>& part) noexcept {
    try {
        part();
    } catch (...) {
        pool_->counts().threw.fetch_add(1, std::memory_order_relaxed);
        fail(std::current_exception());
    }
}

namespace {

constexpr std::size_t most_spare = 1024;

} // namespace

job_record& job_records::take(std::shared_ptr<pool_state> pool) {
    if (spare_.empty()) {
        spare_.push_back(std::make_unique<job_record>());
    }
    auto& r = *spare_.back().release();
    spare_.pop_back();
    r.open(std::move(pool));
    r.index = in_use_.size();
    in_use_.push_back(&r);
    return r;
}

void job_records::recycle(job_record& r) {
    std::unique_ptr<job_record> owned{&r};
    in_use_.back()->index = r.index;
    in_use_[r.index] = in_use_.back();
    in_use_.pop_back();
    r.clear(); // the pool lives: it runs
    if (spare_.size() < most_spare) {
        spare_.push_back(std::move(owned));
    }
}

} // namespace cles::runtime
