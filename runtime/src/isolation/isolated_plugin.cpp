// SPDX-License-Identifier: BSL-1.0
#include "isolation/isolated_plugin.hpp"

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
constexpr std::size_t max_published = 4096;
constexpr std::size_t max_last_output = 500;

} // namespace

isolated_plugin::isolated_plugin(isolated_plugin_node node, load_message loading, session_options session)
    : node_(std::move(node)), loading_(std::move(loading)), session_options_(std::move(session)), name_(loading_.path) {
}

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
    const auto decided = [this] { return unavailable_ || (current_ && current_->usable()); };
    if (!decided()) {
        if (!missing_since_) {
            missing_since_ = clock::now();
        }
        changed_.wait_for(lock, *missing_since_ + max_wait - clock::now(), decided);
    }
    if (unavailable_) {
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
    } catch (const std::system_error& e) {
        throw plugin_error(loading_.path, e.what());
    }
    const auto session = starting_;
    const bool in_time = session->wait_for_start(max_start_time);
    const auto fail = [&](const std::string& why, const std::optional<std::string>& setting = std::nullopt) {
        stopping_ = true;
        ++run_; // its end is no news
        session->close(std::chrono::steady_clock::now());
        starting_.reset();
        withdraw();
        throw plugin_error(loading_.path, why, setting);
    };
    if (refused_) {
        fail(refused_->why, refused_->setting);
    }
    if (!start_failure_.empty()) {
        fail(start_failure_);
    }
    if (!in_time) {
        fail("its start does not end");
    }
    if (starting_) { // it has not said that it has started
        std::string how;
        const auto run = run_;
        session->close(std::chrono::steady_clock::now() + 1s);
        how = run == run_ ? start_failure_ : "";
        fail(how.empty() ? "its process ended while it started" : how);
    }
    first_start_ = false;
    session->run();
}

void isolated_plugin::launch() {
    ++run_;
    refused_.reset();
    start_failure_.clear();
    last_output_.clear();
    starting_ = std::make_shared<plugin_session>(node_.executor, name_, session_options_, events_of(run_));
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
    events.log =
        guarded([](isolated_plugin& self, log_level level, std::string_view text) { self.log_output(level, text); });
    events.output = guarded([](isolated_plugin& self, std::string_view text) {
        self.last_output_ = text.substr(0, max_last_output);
        self.log_output(log_level::info, text);
    });
    events.publish =
        guarded([](isolated_plugin& self, std::string_view noun, std::string_view json) { self.publish(noun, json); });
    events.ended = guarded([run](isolated_plugin& self, const std::string& how) { self.on_ended(run, how); });
    return events;
}

void isolated_plugin::on_started(const started_message& what) {
    start_limit_.reset();
    try {
        {
            const std::scoped_lock lock{mutex_};
            name_ = what.name.empty() ? loading_.path : what.name;
        }
        starting_->set_name(name_);
        offer(what.tasks);
    } catch (const error& e) {
        fail_to_start(e.what());
        return;
    }
    const auto tasks = std::to_string(offered_.size()) + (offered_.size() == 1 ? " task" : " tasks");
    log(log_level::info, (first_start_ ? "runs in process " : "runs again, in process ") +
                             std::to_string(starting_->process()) + ", with " + tasks +
                             "; confined to: " + what.confinement);
    const std::scoped_lock lock{mutex_};
    current_ = std::move(starting_);
    missing_since_.reset();
    unavailable_ = false;
    changed_.notify_all();
}

// It runs, but cannot be used.
void isolated_plugin::fail_to_start(const std::string& why) {
    start_failure_ = why;
    starting_->kill(why);
}

void isolated_plugin::on_ended(std::uint64_t run, const std::string& how) {
    start_limit_.reset();
    auto reason = refused_ ? "refused to start: " + refused_->why : how;
    if (!last_output_.empty() && (starting_ || !refused_)) {
        reason += "; it said last: " + last_output_;
    }
    if (first_start_) { // `start` reports it
        if (start_failure_.empty()) {
            start_failure_ = "its process " + reason;
        }
        return;
    }
    const bool was_starting = starting_ != nullptr;
    starting_.reset();
    {
        const std::scoped_lock lock{mutex_};
        current_.reset();
        if (!missing_since_) {
            missing_since_ = clock::now();
        }
    }
    if (!stopping_ && run == run_) {
        judge_end(was_starting ? reason + ", while it was started again" : reason);
    }
}

// Starts it again, or withdraws its tasks.
void isolated_plugin::judge_end(std::string how) {
    while (policy_.ended(clock::now()) == restart_policy::decision::restart) {
        log(log_level::error, "its process " + how + "; it is started again");
        if (relaunch(how)) {
            return;
        }
    }
    log(log_level::error,
        "its process " + how + ", for the third time within 60 s: its tasks are withdrawn until SIGHUP");
    withdraw();
}

// Returns whether it could; otherwise says why not.
bool isolated_plugin::relaunch(std::string& failure) {
    try {
        launch();
        starting_->run();
    } catch (const std::system_error& e) {
        starting_.reset();
        failure = std::string{"could not be started: "} + e.what();
        return false;
    }
    start_limit_.emplace(node_.executor, max_start_time);
    start_limit_->async_wait([weak = std::weak_ptr{starting_}](boost::system::error_code cancelled) {
        if (const auto session = weak.lock(); session && !cancelled) {
            session->kill("it did not start in time");
        }
    });
    return true;
}

void isolated_plugin::retry() {
    if (stopping_ || !policy_.reset()) {
        return;
    }
    log(log_level::info, "its tasks were withdrawn; it is started again");
    if (std::string failure; !relaunch(failure)) {
        judge_end(std::move(failure));
    }
}

// -- its tasks -----------------------------------------------------------------------------------------------------

void isolated_plugin::offer(const std::vector<offered_task>& tasks) {
    for (const auto& old : offered_) {
        if (std::find(tasks.begin(), tasks.end(), old) == tasks.end()) {
            node_.remove(*verb_from(old.verb), old.task);
        }
    }
    std::erase_if(offered_, [&](const auto& old) { return std::find(tasks.begin(), tasks.end(), old) == tasks.end(); });
    for (const auto& each : tasks) {
        const auto verb = verb_from(each.verb);
        if (!verb) {
            throw error(errc::invalid_name, "its process names an unknown verb");
        }
        if (std::find(offered_.begin(), offered_.end(), each) != offered_.end()) {
            continue;
        }
        registration task{.verb = *verb,
                          .task = each.task,
                          .info = {.description = each.description,
                                   .parameters = each.parameters,
                                   .idempotent = each.idempotent,
                                   .local = each.local,
                                   .must_be_signed = each.must_be_signed}};
        if (each.handled) {
            task.async = [self = shared_from_this()](const request& what, const responder& answer) {
                self->run(what, answer);
            };
        }
        node_.add(std::move(task));
        offered_.push_back(each);
    }
}

void isolated_plugin::withdraw() {
    for (const auto& each : offered_) {
        node_.remove(*verb_from(each.verb), each.task);
    }
    offered_.clear();
    for (const auto& noun : published_) {
        node_.retire(noun);
    }
    published_.clear();
    const std::scoped_lock lock{mutex_};
    unavailable_ = true;
    why_unavailable_ = "the plugin '" + name_ + "' ended too often, and was withdrawn";
    changed_.notify_all();
}

void isolated_plugin::publish(std::string_view noun, std::string_view json) {
    try {
        node_.publish(noun, json_text{std::string{json}});
        if (published_.size() < max_published && !published_.contains(noun)) {
            published_.emplace(noun);
        }
    } catch (const error& e) {
        log_output(log_level::warning, "an update of '" + std::string{noun} + "' was dropped: " + e.message());
    }
}

// -- the end -------------------------------------------------------------------------------------------------------

void isolated_plugin::begin_stop() {
    if (std::exchange(stopping_, true)) {
        return;
    }
    start_limit_.reset();
    const auto why = loading_.node + " has stopped";
    std::shared_ptr<plugin_session> running;
    {
        const std::scoped_lock lock{mutex_};
        unavailable_ = true;
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
            .ended = policy_.count(),
            .jobs = session ? session->open_jobs() : 0};
}

// -- log -----------------------------------------------------------------------------------------------------------

void isolated_plugin::log(log_level level, std::string_view text) { node_.log(level, name_, text); }

// What the process says may be too much.
void isolated_plugin::log_output(log_level level, std::string_view text) {
    if (!budget_.take(clock::now())) {
        return;
    }
    if (const auto dropped = budget_.take_dropped(); dropped != 0) {
        log(log_level::warning, std::to_string(dropped) + " entries of its log came too fast, and were dropped");
    }
    log(level, text);
}

} // namespace cles::runtime
