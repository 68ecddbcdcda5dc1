// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_dispatcher.hpp"

#include "jobs/service_time.hpp"

#include <boost/asio/execution/outstanding_work.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/prefer.hpp>

#include <algorithm>
#include <mutex>
#include <utility>

namespace cles::runtime {

void draining::begin(std::chrono::milliseconds limit, std::function<void()> at_limit,
                     std::function<void(const drain_report&)> done) {
    done_ = std::move(done);
    limit_->expires_after(limit);
    limit_->async_wait([at_limit = std::move(at_limit)](boost::system::error_code code) {
        if (!code) {
            at_limit();
        }
    });
}

void draining::end(const drain_report& how) {
    limit_->cancel();
    const auto done = std::exchange(done_, nullptr);
    done(how);
}

void draining::forget() {
    done_ = nullptr;
    limit_.reset();
}

namespace asio = boost::asio;
using clock = time_point::clock;
using namespace std::chrono_literals;

namespace {

// Jobs of one burst past which further workers are woken at once, instead of when the burst has been read.
constexpr std::size_t most_unwoken = 32;

// When all is read that came during a pause: so many rounds of the executor have brought no job and no withdrawal, or
// this has taken so long.
constexpr unsigned most_quiet_rounds = 16;
constexpr std::chrono::milliseconds longest_reading{250};

std::string seconds(std::chrono::nanoseconds span) {
    const auto tenths = std::chrono::duration_cast<std::chrono::milliseconds>(span).count() / 100;
    return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " s";
}

} // namespace

pool_state::pool_state(asio::any_io_executor executor, pool_options options)
    : executor_(std::move(executor)), options_(std::move(options)), box_([this] {
          // The thread that wakes holds a job, and so this.
          asio::post(executor_, [weak = weak_from_this()] {
              if (const auto self = weak.lock()) {
                  self->collect();
              }
          });
      }),
      workers_(options_, box_), onward_(workers_), tick_(std::in_place, executor_), drain_(executor_),
      patience_(options_.patience) {}

pool_state::~pool_state() = default;

asio::any_io_executor pool_state::executor() const {
    const std::lock_guard lock{executor_mutex_};
    return executor_;
}

void pool_state::start() {
    workers_.start(std::shared_ptr<worker_pool>{shared_from_this(), &workers_}, [this] {
        // Where this fails, the next tick does it.
        static_cast<void>(box_.put([this] { look_for_pause(); }));
    });
    if (options_.look_in.count() > 0) {
        // From when the executor runs, which may take a while.
        asio::post(executor_, [weak = weak_from_this()] {
            if (const auto self = weak.lock()) {
                self->arm_tick();
            }
        });
    }
}

void pool_state::say(log_level level, const log_entry& what) const {
    if (options_.log) {
        options_.log(level, what);
    }
}

// -- records -------------------------------------------------------------------------------------------------------

job_record& pool_state::take_record() {
    auto& r = records_.take(shared_from_this());
    if (records_.size() == 1) {
        busy_ = asio::prefer(executor_, asio::execution::outstanding_work.tracked);
        arm_tick();
    }
    return r;
}

void pool_state::recycle(job_record& r) {
    records_.recycle(r);
    if (records_.size() == 0) {
        busy_ = {};
    }
}

void pool_state::give_back(job_record& r) noexcept {
    if (!box_.put({&r, result_box::news::gone}, !draining_.load(std::memory_order_relaxed))) {
        const std::unique_ptr<job_record> owned{&r};
        const auto keep = std::move(r.pool_);
    }
}

// -- admission -----------------------------------------------------------------------------------------------------

void pool_state::submit(job what) {
    if (closed_) {
        what.answer.fail(errc::unavailable, "its workers have gone");
        return;
    }
    if (draining_) {
        refuse(what.answer, worker_pool::admission::no_workers);
        return;
    }
    notice_pause();
    ++changes_;
    auto& r = take_record();
    r.requester = reinterpret_cast<std::uintptr_t>(&what.what.peer());
    r.request_.keep(what.what, peers_.copy_of(what.what.peer()));
    r.work_ = std::move(what.work);
    const auto admission = workers_.push(r);
    if (admission == worker_pool::admission::full || admission == worker_pool::admission::no_workers) {
        r.answered_ = true;
        recycle(r);
        refuse(what.answer, admission);
        return;
    }
    ++figures_.admitted;
    // The worker may have it by now, and does not look at what is set here.
    answers_.add(r, std::move(what.answer));
    r.answer_->on_stop([this, &r] { stop(r); });
    if (admission == worker_pool::admission::wants_workers) {
        wake_workers();
    }
}

// A job alone is begun at once. With others, more may come with the same read, and workers are woken for all.
void pool_state::wake_workers() {
    if (answers_.size() == 1 || ++unwoken_ >= most_unwoken) {
        unwoken_ = 0;
        workers_.wake();
    } else if (!std::exchange(wake_asked_, true)) {
        asio::post(executor_, [self = shared_from_this()] {
            self->wake_asked_ = false;
            self->unwoken_ = 0;
            self->workers_.wake();
        });
    }
}

void pool_state::refuse(responder& answer, worker_pool::admission why) {
    ++figures_.refused;
    const auto retry = retry_delay(workers_.queued(), workers_.usable(), workers_.count().service_time);
    if (draining_) {
        answer.refuse("it is shutting down", 1s);
    } else if (why == worker_pool::admission::no_workers) {
        answer.refuse("all its workers are stuck", std::max<std::chrono::milliseconds>(retry, 1s));
    } else {
        answer.refuse("its queue is full", retry);
    }
}

// -- results -------------------------------------------------------------------------------------------------------

void pool_state::collect() {
    auto items = std::move(items_);
    auto errands = std::move(errands_);
    items.clear();
    errands.clear();
    box_.take(items, errands);
    for (const auto& [record, what] : items) {
        if (what == result_box::news::gone) {
            recycle(*record);
            continue;
        }
        answers_.tell_progress(*record);
        if (what == result_box::news::ended) {
            figures_.answered += answers_.give(*record) ? 1 : 0;
        }
        let_go(*record);
    }
    for (const auto& errand : errands) {
        errand();
    }
    items_ = std::move(items);
    errands_ = std::move(errands);
    errands_.clear();
    follow_drain(false);
}

void pool_state::let_go(job_record& r) {
    // Who comes here has seen to its answer.
    if (r.references_.fetch_sub(1, std::memory_order_acq_rel) == 1) {
        r.answered_.load() ? recycle(r) : (r.add_reference(), r.release());
    }
}

// -- stopping ------------------------------------------------------------------------------------------------------

void pool_state::stop(job_record& r) {
    ++changes_;
    std::function<void()> callback;
    {
        const std::lock_guard lock{r.mutex_};
        r.stopped_.store(true, std::memory_order_release);
        callback.swap(r.on_stop_);
    }
    answers_.give_up(r);
    if (workers_.take_back(r)) {
        ++figures_.withdrawn;
        r.answered_ = true;
        answers_.conclude(r);
        let_go(r);
        return;
    }
    workers_.expect_end(r, clock::now());
    if (callback) {
        r.add_reference();
        stop_notifier_.notify(
            {.callback = std::move(callback), .log = [job = job_context{r}](log_level level, const std::string& text) {
                 const auto& what = job.request();
                 job.log(level, std::string{to_string(what.verb())} + " '" + std::string{what.task()} + "': " + text);
             }});
    }
}

// -- asking others -------------------------------------------------------------------------------------------------

void pool_state::delegate(job_context asks, std::string command, call_options options, answer_callback answered) {
    const auto asked = std::make_shared<answer_callback>(std::move(answered));
    const auto put = box_.put([this, asks, command = std::move(command), options, asked] {
        const auto& by = asks.record_->answer_;
        onward_.send(asks, by ? &*by : nullptr, command, options, *asked);
    });
    if (put) {
        return;
    }
    // As any other answer: later, and as a part of the job.
    const auto refuse = [asked, ending = draining_.load()] {
        ending ? (*asked)(errc::unavailable, "{}", "the node is stopping")
               : (*asked)(errc::busy, "{}", "too much is asked at once");
    };
    if (!workers_.resume(*asks.record_, refuse)) {
        refuse(); // no worker is left
    }
}

// -- figures -------------------------------------------------------------------------------------------------------

node_load pool_state::load() const noexcept {
    const auto queued = workers_.queued();
    const auto open = static_cast<std::uint32_t>(answers_.size());
    const auto begun = open - std::min(queued, open);
    // Where no worker comes free the next job waits at least as long as that has been so.
    const auto held = std::chrono::duration_cast<std::chrono::microseconds>(workers_.held_for(clock::now())).count();
    constexpr std::int64_t most = 1'000'000'000;
    return {.queued = queued,
            .running = std::max(begun, workers_.running()),
            .workers = workers_.usable(),
            .service_us =
                std::max(workers_.service_us(), static_cast<std::uint32_t>(std::min<std::int64_t>(held, most)))};
}

pool_figures pool_state::figures() const {
    const auto now = load();
    const auto workers = workers_.count();
    auto all = figures_;
    all.threw = counts_.threw.load(std::memory_order_relaxed);
    all.answerless = counts_.answerless.load(std::memory_order_relaxed);
    all.answered_twice = counts_.answered_twice.load(std::memory_order_relaxed);
    all.logs_dropped = counts_.logs_dropped.load(std::memory_order_relaxed);
    all.stuck = workers.stuck;
    all.replaced = workers.replaced;
    all.revived = workers.revived;
    all.queued = now.queued;
    all.running = workers_.running();
    all.waiting = now.running - std::min(now.running, all.running);
    all.workers = now.workers;
    all.stuck_now = workers.stuck_now;
    all.service_time_us =
        static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(workers.service_time).count());
    return all;
}

// -- talking -------------------------------------------------------------------------------------------------------

void pool_state::log(job_context says, log_level level, std::string text) {
    const auto put = box_.put([this, says = std::move(says), level, text = std::move(text)] {
        const auto& r = *says.record_;
        if (r.answer_) {
            r.answer_->log(level, text); // which knows the request's id
        } else {
            say(level, {text, r.request().peer().address});
        }
    });
    if (!put) {
        counts_.logs_dropped.fetch_add(1, std::memory_order_relaxed);
    }
}

void pool_state::note_inline(std::string_view task, std::chrono::nanoseconds took) {
    ++figures_.inline_calls;
    const auto us = static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(took).count());
    figures_.inline_worst_us = std::max(figures_.inline_worst_us, us);
    if (took > options_.slow_inline) {
        ++figures_.inline_slow;
        say(log_level::warning, "the task '" + std::string{task} + "' held up everything else for " +
                                    std::to_string(us / 1000) + " ms: it should not be marked as quick");
    }
}

// -- watching ------------------------------------------------------------------------------------------------------

void pool_state::arm_tick() {
    const bool at_work = records_.size() != 0;
    if (closed_ || (ticking_ && !(idle_tick_ && at_work))) {
        return;
    }
    ticking_ = true;
    idle_tick_ = !at_work;
    tick_span_ = at_work ? std::clamp<std::chrono::milliseconds>(options_.grace / 4, 5ms, 50ms) : options_.look_in;
    expect_tick(clock::now());
    tick_->expires_after(tick_span_);
    tick_->async_wait([weak = weak_from_this()](boost::system::error_code code) {
        if (const auto self = weak.lock(); self && !code) {
            self->tick();
        }
    });
}

void pool_state::tick() {
    ticking_ = false;
    if (closed_) {
        return;
    }
    look_for_pause();
    report_stuck();
    collect(); // what went without a word
    if (records_.size() != 0 || options_.look_in.count() > 0) {
        arm_tick();
    }
}

// -- pauses --------------------------------------------------------------------------------------------------------

void pool_state::expect_tick(time_point now) {
    if (options_.look_in.count() > 0) {
        workers_.expect_executor(now + tick_span_ + options_.late_executor);
    }
}

// The process was stopped, or the machine suspended, or a handler held up the executor: requesters may have
// withdrawn meanwhile, which stands in what has not been read.
void pool_state::notice_pause() {
    const auto now = clock::now();
    if (closed_ || !workers_.executor_is_late(now)) {
        return;
    }
    expect_tick(now);
    if (std::exchange(reading_, true)) {
        return;
    }
    workers_.hold();
    reading_since_ = now;
    quiet_rounds_ = 0;
    changes_before_ = changes_;
    say(log_level::warning, "this node was stopped or held up for more than " +
                                seconds(tick_span_ + options_.late_executor) +
                                ": what came meanwhile is read before a job begins");
    read_on();
}

// A worker that has found the executor late waits to be woken, also where the pause has been dealt with before it says
// so.
void pool_state::look_for_pause() {
    notice_pause();
    if (!reading_ && !closed_) {
        workers_.wake();
    }
}

// What is posted comes after what is ready, and after a look for what has become ready.
void pool_state::read_on() {
    asio::post(executor_, [weak = weak_from_this()] {
        if (const auto self = weak.lock(); self && !self->closed_) {
            self->begin_again();
        }
    });
}

void pool_state::begin_again() {
    quiet_rounds_ = changes_ == changes_before_ ? quiet_rounds_ + 1 : 0;
    changes_before_ = changes_;
    const auto now = clock::now();
    if (quiet_rounds_ < most_quiet_rounds && now - reading_since_ < longest_reading) {
        read_on();
        return;
    }
    reading_ = false;
    expect_tick(now);
    workers_.release();
}

void pool_state::report_stuck() {
    workers_.watch(clock::now(), [this](const worker_watch::finding& found, const job_record& r) {
        say(log_level::error,
            {"worker " + std::to_string(found.place + 1) + " is stuck in " +
                 std::string{to_string(r.request().verb())} + " '" + std::string{r.request().task()} + "' since " +
                 seconds(found.busy_for) +
                 (found.replaced ? ": another takes its place" : ": there is nobody to take its place"),
             r.request().peer().address});
    });
}

// -- the end -------------------------------------------------------------------------------------------------------

void pool_state::drain(std::chrono::milliseconds limit, std::function<void(const drain_report&)> done) {
    draining_ = true;
    drain_.begin(
        limit,
        [weak = weak_from_this()] {
            if (const auto self = weak.lock()) {
                self->follow_drain(true);
            }
        },
        std::move(done));
    asio::post(executor_, [weak = weak_from_this()] {
        if (const auto self = weak.lock()) {
            self->follow_drain(false);
        }
    });
}

void pool_state::follow_drain(bool over) {
    if (!drain_.under_way() || !(over || (answers_.awaited() == 0 && workers_.running() == 0))) {
        return;
    }
    drain_report report;
    if (over) {
        abandon(report);
        patience_ = 0ms;
    }
    report.stuck = workers_.running();
    drain_.end(report);
}

// Answers whatever is open, and tells it to stop.
void pool_state::abandon(drain_report& report) {
    for (std::size_t i = 0; i < records_.size();) {
        auto& r = records_[i];
        if (!r.answer_) {
            ++i;
            continue; // what is taken back leaves the list, and another is in its place
        }
        auto told = *r.answer_;
        const auto before = figures_.withdrawn;
        stop(r);
        if (figures_.withdrawn != before) {
            ++report.refused;
            told.refuse("it is shutting down", 1s);
        } else {
            ++report.abandoned;
            told.fail(errc::unavailable, "it shut down before the job had ended");
            answers_.conclude(r);
        }
    }
}

std::size_t pool_state::close(std::chrono::milliseconds limit) {
    if (closed_) {
        return 0;
    }
    const auto end = clock::now() + limit;
    draining_ = true;
    drain_report unheard;
    abandon(unheard);
    closed_ = true;
    drain_.forget();
    tick_.reset();
    workers_.close([](job_record& r) { r.release(); });
    std::vector<result_box::item> items;
    std::vector<result_box::errand> errands;
    box_.close(items, errands);
    for (const auto& errand : errands) { // what is asked has to be answered
        errand();
    }
    onward_.close();
    records_.disown();
    busy_ = {};
    for (const auto& [record, what] : items) {
        if (what == result_box::news::gone) {
            const std::unique_ptr<job_record> owned{record};
            record->pool_.reset();
        } else {
            record->release();
        }
    }
    errands.clear();
    {
        const std::lock_guard lock{executor_mutex_};
        executor_ = {};
    }
    const auto time_left = [end] {
        return std::max(std::chrono::ceil<std::chrono::milliseconds>(end - clock::now()), 0ms);
    };
    const auto workers = workers_.join(time_left());
    if (workers != 0) {
        say(log_level::error, "workers left behind in jobs that do not end: " + std::to_string(workers));
    }
    const auto callbacks = stop_notifier_.end(time_left());
    if (callbacks != 0) {
        say(log_level::error,
            "threads left behind in on_stop callbacks that do not return: " + std::to_string(callbacks));
    }
    records_.drop_spare();
    return workers + callbacks;
}

} // namespace cles::runtime
