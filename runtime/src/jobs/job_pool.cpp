// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_pool.hpp"

#include <cles/limits.hpp>

#include "jobs/current_trace.hpp"
#include "jobs/service_time.hpp"

#include <boost/asio/execution/outstanding_work.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/prefer.hpp>

#include <algorithm>
#include <mutex>
#include <utility>

namespace cles::runtime {

namespace asio = boost::asio;
using clock = time_point::clock;
using namespace std::chrono_literals;

namespace {

// How many waiting jobs are offered to another node, so that the queue is not locked for long.
constexpr std::size_t most_offered = 256;

// After so many jobs of one burst further workers are woken at once, and not when the burst has been read.
constexpr std::size_t max_unwoken_jobs = 32;

std::string seconds(std::chrono::nanoseconds span) {
    const auto tenths = std::chrono::duration_cast<std::chrono::milliseconds>(span).count() / 100;
    return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " s";
}

// While no worker becomes free, the next job waits at least as long as this has lasted. Rounded up, because zero means
// that nothing is known.
std::chrono::microseconds expected_service_time(const worker_pool::figures& workers) noexcept {
    constexpr std::chrono::microseconds most = 1'000s;
    const auto known = workers.saturated_for.count() == 0 ? workers.recent_service_time
                                                          : std::max(workers.service_time, workers.saturated_for);
    return std::min(std::chrono::ceil<std::chrono::microseconds>(known), most);
}

// A function for the executor that does nothing once the dispatcher has been destroyed.
template <class F>
auto while_alive(std::weak_ptr<job_dispatcher> dispatcher, F call) {
    return [dispatcher = std::move(dispatcher), call](auto... results) {
        if (const auto self = dispatcher.lock()) {
            call(*self, results...);
        }
    };
}

} // namespace

job_pool::job_pool(service& host, pool_options options)
    : dispatcher_(std::make_shared<job_dispatcher>(host.get_executor(), std::move(options))) {
    dispatcher_->start();
}

job_dispatcher::job_dispatcher(asio::any_io_executor executor, pool_options options)
    : executor_(std::move(executor)), options_(std::move(options)), completions_([this] {
          // The thread that wakes the executor holds a job, and so this object.
          asio::post(executor_,
                     while_alive(weak_from_this(), [](job_dispatcher& self) { self.process_completions(); }));
      }),
      workers_(options_, completions_),
      pauses_(executor_, workers_, options_, [this](std::chrono::nanoseconds lasted) { report_pause(lasted); }),
      delegated_(workers_), feeds_(completions_, workers_), timer_(std::in_place, executor_),
      drain_limit_(std::in_place, executor_), close_timeout_(options_.close_timeout) {}

asio::any_io_executor job_dispatcher::executor() const {
    const std::lock_guard lock{executor_mutex_};
    return executor_;
}

void job_dispatcher::start() {
    workers_.start(
        std::shared_ptr<worker_pool>{shared_from_this(), &workers_},
        [this] {
            // If this fails, the next timer does it.
            static_cast<void>(completions_.post([this] { pauses_.check(); }));
        },
        [this] { static_cast<void>(completions_.post([] {})); }); // `process_completions` reports the change
    pauses_.start(std::shared_ptr<pause_detector>{shared_from_this(), &pauses_}, [this] {
        if (sharing_) {
            sharing_->on_change(); // jobs may move again
        }
    });
    if (options_.check_interval.count() > 0) {
        // Once the executor runs, which may be later.
        asio::post(executor_, while_alive(weak_from_this(), [](job_dispatcher& self) { self.arm_timer(); }));
    }
}

void job_dispatcher::write_log(log_level level, const log_entry& what) const {
    if (options_.log) {
        options_.log(level, what);
    }
}

// -- records -------------------------------------------------------------------------------------------------------

job_record& job_dispatcher::acquire_record() {
    auto& r = records_.acquire(shared_from_this());
    if (records_.size() == 1) {
        work_guard_ = asio::prefer(executor_, asio::execution::outstanding_work.tracked);
        arm_timer();
    }
    return r;
}

void job_dispatcher::recycle(job_record& r) {
    records_.recycle(r);
    if (records_.size() == 0) {
        work_guard_ = {};
    }
}

void job_dispatcher::return_record(job_record& r) noexcept {
    if (!completions_.push({&r, completion_queue::event::released}, !draining_.load(std::memory_order_relaxed))) {
        // The pool has been closed.
        const std::unique_ptr<job_record> owned{&r};
        const auto keep = std::move(r.dispatcher_);
    }
}

// -- admission -----------------------------------------------------------------------------------------------------

void job_dispatcher::submit(const request& what, responder answer, std::shared_ptr<const registration> task) {
    if (closed_) {
        answer.fail(errc::unavailable, "its workers have stopped");
        return;
    }
    if (draining_) {
        refuse(answer, worker_pool::admission::no_workers);
        return;
    }
    pauses_.detect();
    pauses_.count_input();
    auto& r = acquire_record();
    r.assign(what, records_.copy_of(what.peer()), std::move(task));
    const auto* const call = sharing_ ? answer.node_call().get() : nullptr;
    r.movable = call != nullptr && sharing_->may_move(*call);
    r.note_phase(job_times::phase::queued);
    if (!what.trace().empty()) {
        answer.record_times({}, {}); // they follow
    }
    const auto admission = workers_.push(r);
    if (admission == worker_pool::admission::full || admission == worker_pool::admission::no_workers) {
        r.answered_ = true;
        recycle(r);
        refuse(answer, admission);
        return;
    }
    ++figures_.admitted;
    // A worker may already run it; workers do not use what is set here.
    r.requester_.emplace(std::move(answer));
    ++open_;
    ++awaited_;
    // By its number, because it may be called after the job has ended.
    r.requester_->on_stop([this, number = r.number] {
        if (auto* const job = records_.find(number)) {
            stop(*job);
        }
    });
    tell_job_status(*r.requester_, [this, number = r.number] { return status_of(number); });
    const bool needs_wake = admission == worker_pool::admission::needs_wake;
    if (needs_wake && (open_ == 1 || ++unwoken_jobs_ >= max_unwoken_jobs)) { // a single job starts at once
        unwoken_jobs_ = 0;
        workers_.wake();
    } else if (needs_wake || sharing_) {
        end_burst_later();
    }
}

job_status job_dispatcher::status_of(std::uint64_t number) const {
    const auto* const job = records_.find(number);
    return job == nullptr ? job_status{}
                          : job_status{.waiting = workers_.is_waiting(*job), .progress = job->reported()};
}

// More jobs may come with the same read: workers are woken for all together, and others are told of those that wait.
void job_dispatcher::end_burst_later() {
    if (std::exchange(burst_end_posted_, true)) {
        return;
    }
    asio::post(executor_, while_alive(weak_from_this(), [](job_dispatcher& self) {
                   self.burst_end_posted_ = false;
                   self.unwoken_jobs_ = 0;
                   self.workers_.wake();
                   if (self.sharing_) {
                       self.sharing_->on_change();
                   }
               }));
}

void job_dispatcher::refuse(responder& answer, worker_pool::admission why) {
    ++figures_.refused;
    const auto workers = workers_.read_figures();
    const auto retry = retry_delay(workers.queued, workers.usable, workers.service_time);
    if (draining_) {
        answer.refuse("it is shutting down", 1s);
    } else if (why == worker_pool::admission::no_workers) {
        answer.refuse("all its workers are stuck", std::max<std::chrono::milliseconds>(retry, 1s));
    } else {
        answer.refuse("its queue is full", retry);
    }
}

// -- results -------------------------------------------------------------------------------------------------------

void job_dispatcher::process_completions() {
    auto entries = std::move(entries_);
    auto functions = std::move(functions_);
    entries.clear();
    functions.clear();
    completions_.take(entries, functions);
    for (const auto& [record, what] : entries) {
        if (what == completion_queue::event::released) {
            recycle(*record);
            continue;
        }
        record->send_progress();
        if (what == completion_queue::event::answered && record->requester_) {
            record->send_answer();
            forget_requester(*record);
            ++figures_.answered;
        }
        release_record(*record);
    }
    for (const auto& function : functions) {
        function();
    }
    entries_ = std::move(entries);
    functions_ = std::move(functions);
    functions_.clear();
    report_change();
    update_drain(false);
}

// It has its answer, or has withdrawn.
void job_dispatcher::forget_requester(job_record& r) {
    if (r.requester_) {
        r.requester_.reset();
        --open_;
        awaited_ -= r.stopped() ? 0 : 1;
    }
}

void job_dispatcher::release_record(job_record& r) {
    // The caller has dealt with its answer.
    if (r.references_.fetch_sub(1, std::memory_order_acq_rel) == 1) {
        r.answered_.load() ? recycle(r) : (r.add_reference(), r.release());
    }
}

// -- stopping ------------------------------------------------------------------------------------------------------

job_dispatcher::stopped_job job_dispatcher::stop(job_record& r) {
    pauses_.count_input();
    r.report_times();
    awaited_ -= r.requester_ && !r.stopped() ? 1 : 0;
    auto callback = r.on_stop_.stop();
    const bool moved = r.moved_ != 0;
    if (moved) {
        sharing_->withdraw(r.moved_);
        end_move(r, false);
        return stopped_job::moved;
    }
    if (workers_.withdraw(r)) {
        ++figures_.withdrawn;
        r.answered_ = true;
        forget_requester(r);
        release_record(r);
        return stopped_job::waiting;
    }
    workers_.job_stopped(r, clock::now());
    if (callback) {
        stop_notifier_.notify(
            {.callback = std::move(callback), .log = [job = job_ptr{&r}](log_level level, const std::string& text) {
                 const auto& what = job->request();
                 job->log(level, std::string{to_string(what.verb())} + " '" + std::string{what.task()} + "': " + text);
             }});
    }
    return stopped_job::started;
}

// -- jobs that other nodes run -------------------------------------------------------------------------------------

shareable_queue::state job_dispatcher::read_state() const {
    const auto workers = workers_.read_figures();
    return {.waiting = workers.queued,
            .idle = workers.usable - std::min(workers.running, workers.usable),
            .workers = workers.usable,
            .service_time = expected_service_time(workers),
            .movable = pauses_.may_start() ? workers.movable : 0, // else some may have been withdrawn
            .movable_queued = workers.movable_queued,
            .draining = draining_};
}

void job_dispatcher::offer(job_taker& to) {
    const auto taken = workers_.take(
        most_offered,
        [&](const job_record& r, std::size_t ahead, std::chrono::nanoseconds service_time) {
            const auto* const call = r.requester_ ? r.requester_->node_call().get() : nullptr;
            return call != nullptr &&
                   to.choose(*call, ahead, std::chrono::ceil<std::chrono::microseconds>(service_time));
        },
        [&] { return to.full(); });
    for (auto* r : taken) {
        r->report_times();
        r->note_phase(job_times::phase::elsewhere);
        ++moved_;
        r->moved_ = to.take(r->requester_->node_call(), r->request().body(),
                            [this, r](bool refused) { end_move(*r, refused); });
    }
}

// Jobs have ended.
void job_dispatcher::report_change() {
    if (!sharing_) {
        return;
    }
    sharing_->on_change();
    // A job may have answered before its worker is free; then another change follows.
    const auto workers = workers_.read_figures();
    const bool frees_soon =
        workers.queued == 0 && workers.running >= workers.usable && open_ - moved_ < workers.running;
    if (frees_soon && !workers_.notify_when_free()) {
        sharing_->on_change();
    }
}

// Refused: it returns to the queue. Otherwise it has ended, here at least.
void job_dispatcher::end_move(job_record& r, bool refused) {
    r.moved_ = 0;
    --moved_;
    if (refused && workers_.put_back(r)) {
        workers_.wake();
        return;
    }
    ++figures_.moved;
    r.answered_ = true;
    forget_requester(r);
    release_record(r);
    if (on_drained_) {
        asio::post(executor_, while_alive(weak_from_this(), [](job_dispatcher& self) { self.update_drain(false); }));
    }
}

// -- requests to other nodes ---------------------------------------------------------------------------------------

void job_dispatcher::delegate(job_ptr job, std::string command, call_options options, answer_callback answered) {
    const auto callback = std::make_shared<answer_callback>(std::move(answered));
    const auto put = completions_.post([this, job, command = std::move(command), options, callback] {
        const auto& by = job->requester_;
        delegated_.send(job, by ? &*by : nullptr, command, options, *callback);
    });
    if (put) {
        return;
    }
    // Like any other answer: later, as a continuation of the job.
    const auto refuse = [callback, ending = draining_.load()] {
        ending ? (*callback)(errc::unavailable, "{}", "the node is stopping")
               : (*callback)(errc::busy, "{}", "too many requests at once");
    };
    if (!workers_.schedule(*job, refuse)) {
        refuse(); // no worker is left
    }
}

std::shared_ptr<detail::job_feed_control> job_dispatcher::bind(job_ptr job, std::string noun, bind_options options) {
    const auto number = feeds_.new_number();
    // If the pool has been closed, `next` tells.
    static_cast<void>(
        completions_.post_always([this, job, number, noun = std::move(noun), options = std::move(options)] {
            const auto& by = job->requester_;
            feeds_.open(number, by ? &*by : nullptr, noun, options);
        }));
    return feeds_.handle_of(number, std::move(job));
}

// -- figures -------------------------------------------------------------------------------------------------------

node_load job_dispatcher::load() const noexcept {
    const auto workers = workers_.read_figures();
    const auto open = static_cast<std::uint32_t>(open_ - moved_);
    const auto started = open - std::min(workers.queued, open);
    return {.queued = workers.queued,
            .running = std::max(started, workers.running),
            .workers = workers.usable,
            .service_us = static_cast<std::uint32_t>(expected_service_time(workers).count())};
}

pool_figures job_dispatcher::figures() const {
    const auto now = load();
    const auto workers = workers_.read_figures();
    auto all = figures_;
    all.threw = counts_.threw.load(std::memory_order_relaxed);
    all.answerless = counts_.answerless.load(std::memory_order_relaxed);
    all.answered_twice = counts_.answered_twice.load(std::memory_order_relaxed);
    all.logs_dropped = counts_.logs_dropped.load(std::memory_order_relaxed);
    all.stuck = workers.stuck;
    all.replaced = workers.replaced;
    all.revived = workers.revived;
    all.queued = now.queued;
    all.running = workers.running;
    all.waiting = now.running - std::min(now.running, all.running);
    all.workers = now.workers;
    all.stuck_now = workers.stuck_now;
    all.service_time_us =
        static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(workers.service_time).count());
    return all;
}

// -- log -----------------------------------------------------------------------------------------------------------

void job_dispatcher::log(job_ptr job, log_level level, std::string text) {
    const auto put = completions_.post([this, job = std::move(job), level, text = std::move(text)] {
        const auto& r = *job;
        if (r.requester_) {
            r.requester_->log(level, text); // adds the request's id
        } else {
            const auto& what = r.request();
            write_log(level, {text, what.peer().address, 0, current_trace::id_in(what.trace())});
        }
    });
    if (!put) {
        counts_.logs_dropped.fetch_add(1, std::memory_order_relaxed);
    }
}

void job_dispatcher::record_inline_call(std::string_view task, std::chrono::nanoseconds took) {
    ++figures_.inline_calls;
    const auto us = static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(took).count());
    figures_.inline_worst_us = std::max(figures_.inline_worst_us, us);
    if (took > options_.slow_inline) {
        ++figures_.inline_slow;
        write_log(log_level::warning, "the task '" + std::string{task} + "' blocked the node for " +
                                          std::to_string(us / 1000) + " ms: it should not be marked inline_ok");
    }
}

// -- timer ---------------------------------------------------------------------------------------------------------

void job_dispatcher::arm_timer() {
    const bool has_jobs = records_.size() != 0;
    if (closed_ || (timer_armed_ && !(timer_idle_ && has_jobs))) {
        return;
    }
    timer_armed_ = true;
    timer_idle_ = !has_jobs;
    const auto interval =
        has_jobs ? std::clamp<std::chrono::milliseconds>(options_.grace / 4, 5ms, 50ms) : options_.check_interval;
    pauses_.expect_timer(interval);
    timer_->expires_after(interval);
    timer_->async_wait(while_alive(weak_from_this(), [](job_dispatcher& self, boost::system::error_code code) {
        if (!code) {
            self.on_timer();
        }
    }));
}

void job_dispatcher::on_timer() {
    timer_armed_ = false;
    if (closed_) {
        return;
    }
    if (records_.size() != 0) {
        pauses_.check();
    } else {
        pauses_.report(); // the next job finds out how long the executor has waited
    }
    report_stuck();
    process_completions(); // deferred ones
    if (records_.size() != 0 || options_.check_interval.count() > 0) {
        arm_timer();
    }
}

// -- pauses and stuck workers --------------------------------------------------------------------------------------

void job_dispatcher::report_pause(std::chrono::nanoseconds lasted) {
    write_log(log_level::warning, "this node was suspended or blocked for more than " + seconds(lasted) +
                                      ": no job starts until the input that arrived since has been read");
}

void job_dispatcher::report_stuck() {
    for (const auto& [worker, job] : workers_.check_stuck(clock::now())) {
        const auto& what = job->request();
        write_log(log_level::error,
                  {"worker " + std::to_string(worker.slot + 1) + " is stuck in " + std::string{to_string(what.verb())} +
                       " '" + std::string{what.task()} + "' for " + seconds(worker.busy_for) +
                       (worker.replaced ? ": replaced by another" : ": no replacement is left"),
                   what.peer().address, 0, current_trace::id_in(what.trace())});
    }
}

// -- the end -------------------------------------------------------------------------------------------------------

void job_dispatcher::drain(std::chrono::milliseconds limit, std::function<void(const drain_report&)> done) {
    draining_ = true;
    on_drained_ = std::move(done);
    drain_limit_->expires_after(limit);
    drain_limit_->async_wait(while_alive(weak_from_this(), [](job_dispatcher& self, boost::system::error_code code) {
        if (!code) {
            self.update_drain(true);
        }
    }));
    asio::post(executor_, while_alive(weak_from_this(), [](job_dispatcher& self) { self.update_drain(false); }));
}

// Ends the drain at its limit, or with the last job.
void job_dispatcher::update_drain(bool at_limit) {
    if (!on_drained_ || !(at_limit || (awaited_ == 0 && workers_.read_figures().running == 0))) {
        return;
    }
    drain_report report;
    if (at_limit) {
        fail_open_jobs(report);
        close_timeout_ = 0ms;
    }
    report.stuck = workers_.read_figures().running;
    drain_limit_->cancel();
    std::exchange(on_drained_, nullptr)(report);
}

// Answers all open jobs, and tells them to stop.
void job_dispatcher::fail_open_jobs(drain_report& report) {
    records_.for_each([&](job_record& r) {
        if (!r.requester_) {
            return;
        }
        const auto requester = *r.requester_;
        const auto was = stop(r);
        if (was == stopped_job::waiting) {
            ++report.refused;
            requester.refuse("it is shutting down", 1s);
            return;
        }
        ++report.abandoned;
        requester.fail(errc::unavailable, "it shut down before the job had ended");
        if (was == stopped_job::started) {
            forget_requester(r);
        }
    });
}

std::size_t job_dispatcher::close(std::chrono::milliseconds limit) {
    if (closed_) {
        return 0;
    }
    const auto end = clock::now() + limit;
    draining_ = true;
    drain_report unreported;
    fail_open_jobs(unreported);
    sharing_.reset();
    closed_ = true;
    pauses_.close();
    on_drained_ = nullptr;
    drain_limit_.reset();
    timer_.reset();
    workers_.close();
    std::vector<completion_queue::entry> entries;
    std::vector<completion_queue::function> functions;
    completions_.close(entries, functions);
    for (const auto& function : functions) { // their requests have to be answered
        function();
    }
    delegated_.close();
    feeds_.close();
    records_.close();
    work_guard_ = {};
    for (const auto& [record, what] : entries) {
        what == completion_queue::event::released ? return_record(*record) : record->release();
    }
    functions.clear();
    {
        const std::lock_guard lock{executor_mutex_};
        executor_ = {};
    }
    const auto time_left = [end] {
        return std::max(std::chrono::ceil<std::chrono::milliseconds>(end - clock::now()), 0ms);
    };
    const auto workers = workers_.join(time_left());
    if (workers != 0) {
        write_log(log_level::error, "workers abandoned in jobs that do not end: " + std::to_string(workers));
    }
    const auto callbacks = stop_notifier_.close(time_left());
    if (callbacks != 0) {
        write_log(log_level::error,
                  "threads abandoned in on_stop callbacks that do not return: " + std::to_string(callbacks));
    }
    return workers + callbacks;
}

} // namespace cles::runtime
