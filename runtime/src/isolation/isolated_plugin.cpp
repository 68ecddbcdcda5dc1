// SPDX-License-Identifier: BSL-1.0
#include "isolation/isolated_plugin.hpp"

#include <cles/schema.hpp>

#include "jobs/pooled_registrar.hpp"
#include "plugins/plugin_error.hpp"

#include <algorithm>
#include <exception>
#include <system_error>
#include <utility>

namespace cles::runtime {

using clock = time_point::clock;
using namespace std::chrono_literals;

namespace {

constexpr std::chrono::seconds max_start_time{10};
// How long jobs hold their workers while the process is started again. Then they are refused, because a plugin that
// takes long to start must not keep the workers from other plugins.
constexpr std::chrono::seconds max_wait{1};
constexpr std::chrono::milliseconds retry_after{250};
constexpr std::size_t max_last_output = 500;
constexpr std::size_t max_name = 100;

} // namespace

isolated_plugin::isolated_plugin(service& host, job_pool& pool, plugin_log log, load_message loading,
                                 session_options session)
    : host_(host), pool_(pool), log_(std::move(log)), loading_(std::move(loading)),
      session_options_(std::move(session)), name_(loading_.path) {}

// -- jobs, on workers ----------------------------------------------------------------------------------------------

void isolated_plugin::run(const request& what, const responder& answer) {
    while (const auto session = session_for(answer)) {
        if (session->serve(what, answer)) {
            return;
        }
    }
}

// Waits for a process that takes jobs. If there is none in time, answers, and returns null.
std::shared_ptr<plugin_session> isolated_plugin::session_for(const responder& answer) {
    std::unique_lock lock{mutex_};
    const auto decided = [this] { return !why_unavailable_.empty() || (current_ && current_->usable()); };
    if (!decided()) {
        if (!missing_since_) {
            missing_since_ = clock::now();
        }
        changed_.wait_for(lock, *missing_since_ + max_wait - clock::now(), decided);
    }
    if (!why_unavailable_.empty()) {
        const auto why = why_unavailable_;
        lock.unlock();
        answer.fail(errc::unavailable, why);
        return nullptr;
    }
    if (!decided()) {
        const auto why = "the plugin '" + name_ + "' is being started again";
        lock.unlock();
        answer.refuse(why, retry_after);
        return nullptr;
    }
    return current_;
}

// -- its process ---------------------------------------------------------------------------------------------------

void isolated_plugin::start() {
    try {
        launch();
    } catch (const std::exception& e) {
        throw plugin_error(loading_.path, e.what());
    }
    const auto session = starting_;
    const bool in_time = session->wait_for_start(max_start_time);
    const auto fail = [&](const std::string& why, const std::string& key = "path") {
        stopping_ = true;
        ++run_; // its end is no news
        session->close(std::chrono::steady_clock::now());
        starting_.reset();
        withdraw();
        throw plugin_error(loading_.path, why, key);
    };
    if (refused_) {
        fail(refused_->why, refused_->key);
    }
    if (!start_failure_.empty()) {
        fail(start_failure_);
    }
    if (!in_time) {
        fail("its start does not end");
    }
    if (starting_) { // it has not said that it has started
        session->close(std::chrono::steady_clock::now() + 1s);
        fail(start_failure_.empty() ? "its process ended while it started" : start_failure_);
    }
    first_start_ = false;
    session->run();
}

void isolated_plugin::launch() {
    ++run_;
    refused_.reset();
    start_failure_.clear();
    last_output_.clear();
    starting_ = std::make_shared<plugin_session>(host_.get_executor(), name_, session_options_, events_of(run_));
    loading_.require_paths = first_start_; // a device may be unplugged while it runs
    starting_->load(loading_);
}

session_events isolated_plugin::events_of(std::uint64_t run) {
    // They may come after this has been destroyed, or a later process has been started.
    const auto guarded = [weak = weak_from_this(), run](auto call) {
        return [weak, run, call](const auto&... what) {
            if (const auto self = weak.lock(); self && self->run_ == run) {
                call(*self, what...);
            }
        };
    };
    session_events events;
    events.started = guarded([](isolated_plugin& self, const started_message& what) { self.on_started(what); });
    events.refused = guarded([](isolated_plugin& self, const refused_message& what) { self.refused_ = what; });
    events.log = guarded([](isolated_plugin& self, log_level level, std::string_view text, const responder* job) {
        self.log_output(level, text, job);
    });
    events.output = guarded([](isolated_plugin& self, std::string_view text) {
        self.last_output_ = text.substr(0, max_last_output);
        self.log_output(log_level::info, text);
    });
    events.publish =
        guarded([](isolated_plugin& self, std::string_view noun, std::string_view json) { self.publish(noun, json); });
    events.ended = guarded([](isolated_plugin& self, const process_end& how) { self.on_ended(how); });
    return events;
}

void isolated_plugin::on_started(const started_message& what) {
    if (stopping_ || !starting_) {
        return;
    }
    start_timer_.reset();
    try {
        {
            const std::scoped_lock lock{mutex_};
            name_ = what.name.empty() ? loading_.path : what.name.substr(0, max_name);
        }
        starting_->set_name(name_);
        offer(what.tasks);
    } catch (const error& e) { // it runs, but cannot be used
        start_failure_ = e.what();
        starting_->kill(start_failure_);
        return;
    }
    const auto tasks = std::to_string(offered_.size()) + (offered_.size() == 1 ? " task" : " tasks");
    log(log_level::info, (first_start_ ? "runs in process " : "runs again, in process ") +
                             std::to_string(starting_->process()) + ", with " + tasks +
                             "; confined to: " + what.confinement);
    for (const auto& each : what.missing) {
        log_output(log_level::warning, each);
    }
    const std::scoped_lock lock{mutex_};
    current_ = std::move(starting_);
    missing_since_.reset();
    why_unavailable_.clear();
    changed_.notify_all();
}

void isolated_plugin::on_ended(const process_end& how) {
    start_timer_.reset();
    auto why = describe(how);
    if (first_start_) { // `start` reports it
        if (start_failure_.empty()) {
            start_failure_ = std::move(why);
        }
        return;
    }
    starting_.reset();
    {
        const std::scoped_lock lock{mutex_};
        current_.reset();
        if (!missing_since_) {
            missing_since_ = clock::now();
        }
    }
    if (stopping_) {
        return;
    }
    ++ended_;
    if (policy_.ended(clock::now()) == restart_policy::decision::restart) {
        log(log_level::error, why + ". Restarting.");
        relaunch();
    } else {
        log(log_level::error, "third end within 60 s; the last: " + why + ". Its tasks are withdrawn until SIGHUP.");
        withdraw();
    }
}

std::string isolated_plugin::describe(const process_end& how) const {
    if (refused_) {
        return "its process refused to start: " + refused_->why;
    }
    const bool again = starting_ && !first_start_;
    return "its process " + (again ? "crashed again while starting: " + how.cause : how.text()) +
           (last_output_.empty() ? "" : "; last output: '" + last_output_ + "'");
}

void isolated_plugin::restart_after(std::chrono::milliseconds delay, const std::string& why) {
    log(log_level::error, why + ". Restarting in " + std::to_string(delay.count()) + " ms.");
    start_timer_.emplace(host_.get_executor(), delay);
    start_timer_->async_wait([weak = weak_from_this()](boost::system::error_code cancelled) {
        if (const auto self = weak.lock(); self && !cancelled && !self->stopping_) {
            self->relaunch();
        }
    });
}

void isolated_plugin::relaunch() {
    try {
        launch();
        starting_->run();
    } catch (const std::exception& e) { // too many open files, for example
        starting_.reset();
        restart_after(policy_.delay(clock::now()), std::string{"its process could not be started: "} + e.what());
        return;
    }
    start_timer_.emplace(host_.get_executor(), max_start_time);
    start_timer_->async_wait([weak = std::weak_ptr{starting_}](boost::system::error_code cancelled) {
        if (const auto session = weak.lock(); session && !cancelled) {
            session->kill("it did not start in time");
        }
    });
}

bool isolated_plugin::retry(std::optional<load_message> changed) {
    if (stopping_ || !policy_.reset()) {
        return false;
    }
    log(log_level::info, std::string{"its tasks were withdrawn. Restarting on SIGHUP with the "} +
                             (changed ? "new" : "old") + " configuration.");
    if (changed) {
        loading_ = std::move(*changed);
    }
    relaunch();
    return true;
}

// -- its tasks -----------------------------------------------------------------------------------------------------

void isolated_plugin::offer(const std::vector<offered_task>& tasks) {
    std::erase_if(offered_, [&](const auto& old) {
        if (std::find(tasks.begin(), tasks.end(), old) != tasks.end()) {
            return false;
        }
        remove(old);
        return true;
    });
    for (const auto& each : tasks) {
        const auto verb = verb_from(each.verb);
        if (!verb) {
            throw error(errc::invalid_name, "its process names an unknown verb");
        }
        if (std::find(offered_.begin(), offered_.end(), each) != offered_.end()) {
            continue;
        }
        registration task{.verb = *verb, .task = each.task, .info = each.info};
        if (!task.info.types.empty()) { // the other process is not trusted to tell schemas
            task.info.types = task_types(read_task_types(task.info.types));
        }
        if (each.handled) {
            task.async = [self = shared_from_this()](const request& what, const responder& answer) {
                self->run(what, answer);
            };
        }
        pooled_registrar{host_, pool_}.add(std::move(task));
        offered_.push_back(each);
    }
}

void isolated_plugin::remove(const offered_task& task) {
    host_.remove(*verb_from(task.verb), task.task);
    host_.retire_all(task.task);
}

void isolated_plugin::withdraw() {
    for (const auto& each : offered_) {
        remove(each);
    }
    offered_.clear();
    const std::scoped_lock lock{mutex_};
    why_unavailable_ = "the plugin '" + name_ + "' ended too often, and was withdrawn";
    changed_.notify_all();
}

void isolated_plugin::publish(std::string_view noun, std::string_view json) {
    try {
        const auto task = noun.substr(0, noun.find('/'));
        if (std::ranges::find(offered_, task, &offered_task::task) == offered_.end()) {
            throw error(errc::denied, "it is no task of the plugin");
        }
        host_.update(noun, json_text{std::string{json}});
    } catch (const error& e) {
        log_output(log_level::warning, "an update of '" + std::string{noun} + "' was dropped: " + e.message());
    }
}

// -- the end -------------------------------------------------------------------------------------------------------

void isolated_plugin::begin_stop() {
    if (std::exchange(stopping_, true)) {
        return;
    }
    start_timer_.reset();
    const auto why = loading_.node + " has stopped";
    std::shared_ptr<plugin_session> running;
    {
        const std::scoped_lock lock{mutex_};
        why_unavailable_ = why;
        running = current_;
        changed_.notify_all();
    }
    for (const auto& session : {running, starting_}) {
        if (session) {
            session->leave(why);
        }
    }
}

bool isolated_plugin::finish_stop(std::chrono::steady_clock::time_point until) {
    std::shared_ptr<plugin_session> running;
    {
        const std::scoped_lock lock{mutex_};
        running = std::move(current_);
    }
    bool late = false;
    for (const auto& session : {running, std::exchange(starting_, nullptr)}) {
        late = (session && session->close(until)) || late;
    }
    return late;
}

isolated_plugin_figures isolated_plugin::figures() const {
    const std::scoped_lock lock{mutex_};
    const auto& session = current_ ? current_ : starting_;
    return {.name = name_,
            .state = current_              ? "running"
                     : policy_.withdrawn() ? "withdrawn"
                                           : "starting",
            .process = session ? static_cast<std::uint64_t>(session->process()) : 0,
            .ended = ended_,
            .jobs = session ? session->open_jobs() : 0};
}

// -- log -----------------------------------------------------------------------------------------------------------

void isolated_plugin::log(log_level level, std::string_view text) { log_(level, name_, text); }

// What the process says may be too much.
void isolated_plugin::log_output(log_level level, std::string_view text, const responder* job) {
    if (!log_rate_.take(clock::now())) {
        return;
    }
    if (const auto dropped = log_rate_.take_dropped(); dropped != 0) {
        log(log_level::warning, std::to_string(dropped) + " entries of its log came too fast, and were dropped");
    }
    job != nullptr ? job->log(level, text) : log(level, text);
}

} // namespace cles::runtime
