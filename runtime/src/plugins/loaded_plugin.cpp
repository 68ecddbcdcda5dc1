// SPDX-License-Identifier: BSL-1.0
#include "plugins/loaded_plugin.hpp"

#include <cles/plugin_text.hpp>

#include "plugins/plugin_jobs.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <exception>
#include <memory>
#include <thread>
#include <utility>

namespace cles::runtime {
namespace {

struct checked_json {
    std::string text;
};

} // namespace
} // namespace cles::runtime

template <>
struct cles::converter<cles::runtime::checked_json> {
    static void write(json_writer& w, const runtime::checked_json& value) { w.raw(value.text); }
};

namespace cles::runtime {
namespace {

using detail::abi_text;
using detail::known_part;
using detail::view_of;

constexpr std::size_t most_parameters = 32; // of a request (docs/protocol.md)

void answer_with(const responder& to, std::string_view json) {
    if (json.empty()) {
        to.done();
        return;
    }
    try {
        to.done(checked_json{to_json(json_text{std::string{json}})});
    } catch (...) {
        to.fail(errc::failed, "the plugin's answer is not JSON");
    }
}

log_level level_of(std::uint32_t level) {
    return static_cast<log_level>(std::min(level, CLES_LOG_ERROR)); // a newer plugin may know worse
}

} // namespace

// -- what a plugin calls -------------------------------------------------------------------------------------------

// No exception may leave any of these.
struct loaded_plugin::from_plugin {
    static loaded_plugin& self(const cles_host* host) noexcept {
        return *reinterpret_cast<const host_functions*>(host)->of; // NOLINT(*-reinterpret-cast): its first member
    }

    static std::int32_t add_task(const cles_host* host, const cles_task* task) noexcept {
        try {
            return self(host).add_task(known_part(task));
        } catch (...) {
            return CLES_BAD_TASK;
        }
    }
    static void refuse(const cles_host* host, cles_text why) noexcept {
        auto& plugin = self(host);
        if (plugin.may_refuse_ && plugin.refusal_.empty()) {
            plugin.refusal_ = view_of(why);
        }
    }
    static void refuse_setting(const cles_host* host, cles_text key, cles_text why) noexcept {
        auto& plugin = self(host);
        if (plugin.may_refuse_ && plugin.refusal_.empty()) {
            plugin.refusal_ = view_of(why);
            plugin.refused_setting_ = view_of(key);
        }
    }
    static void publish(const cles_host* host, cles_text noun, cles_text json) noexcept {
        auto& plugin = self(host);
        try {
            plugin.updates_->update(view_of(noun), json_text{std::string{view_of(json)}});
        } catch (const error& e) {
            plugin.say(log_level::warning,
                       "an update of '" + std::string{view_of(noun)} + "' is not valid JSON: " + e.message());
        } catch (...) { // no memory
        }
    }
    static void log(const cles_host* host, std::uint32_t level, cles_text text) noexcept {
        self(host).say(level_of(level), view_of(text));
    }

    static void done(const cles_host* host, cles_job job, cles_text json) noexcept {
        auto& plugin = self(host);
        if (const auto here = plugin.jobs_.take_here(job)) {
            answer_with(*here, view_of(json));
        } else if (!plugin.jobs_.finish(
                       job, [text = std::string{view_of(json)}](const responder& to) { answer_with(to, text); })) {
            plugin.note_unknown();
        }
    }
    static void fail(const cles_host* host, cles_job job, cles_text code, cles_text message) noexcept {
        auto& plugin = self(host);
        const auto why = errc_from_wire(view_of(code));
        if (!plugin.jobs_.finish(
                job, [why, words = std::string{view_of(message)}](const responder& to) { to.fail(why, words); })) {
            plugin.note_unknown();
        }
    }
    static void busy(const cles_host* host, cles_job job, cles_text message, std::uint32_t retry_ms) noexcept {
        auto& plugin = self(host);
        if (!plugin.jobs_.finish(job, [words = std::string{view_of(message)}, retry_ms](const responder& to) {
                to.refuse(words, std::chrono::milliseconds{retry_ms});
            })) {
            plugin.note_unknown();
        }
    }
    static std::int32_t progress(const cles_host* host, cles_job job, double fraction, cles_text json) noexcept {
        const auto report = [fraction, text = std::string{view_of(json)}](const responder& to) {
            try {
                to.progress(fraction, json_text{text.empty() ? "{}" : text});
            } catch (...) { // no JSON: a report that is lost harms nobody
            }
        };
        auto& jobs = self(host).jobs_;
        return !jobs.stopped(job) && jobs.use(job, report) ? 1 : 0;
    }
    static std::int32_t stopped(const cles_host* host, cles_job job) noexcept {
        return self(host).jobs_.stopped(job) ? 1 : 0;
    }
    static void on_stop(const cles_host* host, cles_job job, const cles_callback* callback) noexcept {
        self(host).jobs_.on_stop(job, plugin_callback{callback->call, callback->drop, callback->user});
    }
    static void delegate(const cles_host* host, cles_job job, cles_text command, const cles_ask* ask) noexcept {
        self(host).delegate(job, view_of(command), known_part(ask));
    }
    static void job_log(const cles_host* host, cles_job job, std::uint32_t level, cles_text text) noexcept {
        auto& plugin = self(host);
        const auto how = level_of(level);
        const auto line = plugin.name_ + ": " + std::string{view_of(text)};
        if (!plugin.jobs_.use(job, [how, line](const responder& to) { to.log(how, line); })) {
            plugin.say(how, view_of(text));
        }
    }
};

loaded_plugin::loaded_plugin(const cles_plugin& description, std::string node, plugin_jobs& jobs,
                             stop_notifier& notifier, plugin_log log)
    : description_(description), name_(view_of(description.name)), version_(view_of(description.version)),
      node_(std::move(node)), jobs_(jobs), notifier_(notifier),
      log_(std::move(log)), host_{.face = {.size = sizeof(cles_host),
                                           .abi_minor = CLES_PLUGIN_ABI_MINOR,
                                           .node = abi_text(node_),
                                           .add_task = &from_plugin::add_task,
                                           .refuse = &from_plugin::refuse,
                                           .publish = &from_plugin::publish,
                                           .log = &from_plugin::log,
                                           .done = &from_plugin::done,
                                           .fail = &from_plugin::fail,
                                           .busy = &from_plugin::busy,
                                           .progress = &from_plugin::progress,
                                           .stopped = &from_plugin::stopped,
                                           .on_stop = &from_plugin::on_stop,
                                           .delegate = &from_plugin::delegate,
                                           .job_log = &from_plugin::job_log,
                                           .refuse_setting = &from_plugin::refuse_setting},
                                  .of = this} {}

void loaded_plugin::say(log_level level, std::string_view text) const {
    const std::scoped_lock lock{log_mutex_};
    if (log_) {
        log_(level, name_, text);
    }
}

void loaded_plugin::silence() noexcept {
    const std::scoped_lock lock{log_mutex_};
    log_ = nullptr;
}

void loaded_plugin::note_unknown() {
    if (!closed_ && !noted_unknown_.exchange(true)) {
        say(log_level::warning, "answered a job that was answered before, or never was; said once");
    }
}

// -- its beginning and end -----------------------------------------------------------------------------------------

// Calls a function of the plugin that returns 0, or something else after it has said why not.
template <class F>
std::optional<loaded_plugin::refusal> loaded_plugin::guarded(const char* what, F&& call) {
    may_refuse_ = true;
    bool fine = false;
    std::string thrown;
    try {
        fine = call() == 0;
    } catch (const std::exception& e) {
        thrown = std::string{what} + " threw: " + e.what();
    } catch (...) {
        thrown = std::string{what} + " threw something that is no exception";
    }
    may_refuse_ = false;
    if (fine) {
        return std::nullopt;
    }
    if (!thrown.empty()) {
        return refusal{.why = std::move(thrown), .setting = std::nullopt};
    }
    return refusal{.why = refusal_.empty() ? "it refuses to start and does not say why" : refusal_,
                   .setting = refused_setting_};
}

std::optional<loaded_plugin::refusal> loaded_plugin::check(const std::string& config) {
    if (description_.check == nullptr) {
        return std::nullopt;
    }
    return guarded("its check of its settings", [&] { return description_.check(&host_.face, abi_text(config)); });
}

std::optional<loaded_plugin::refusal> loaded_plugin::start(const std::string& config, publisher updates,
                                                           const taken& by_other) {
    updates_ = std::move(updates);
    taken_ = &by_other;
    auto refused = guarded("its start", [&] { return description_.start(&host_.face, abi_text(config)); });
    taken_ = nullptr;
    if (refused) {
        closed_ = true;
        return refused;
    }
    stopped_ = false;
    if (!refusal_.empty()) {
        say(log_level::warning, "goes without a task: " + refusal_);
    }
    return std::nullopt;
}

std::int32_t loaded_plugin::add_task(const cles_task& added) {
    if (taken_ == nullptr) {
        return CLES_TOO_LATE;
    }
    const auto refuse = [&](std::int32_t code, std::string why) {
        if (refusal_.empty()) {
            refusal_ = std::move(why);
        }
        return code;
    };
    const std::string name{view_of(added.name)};
    if (added.verb >= verb_count) {
        return refuse(CLES_BAD_TASK, "'" + name + "' is of a verb that does not exist");
    }
    const auto verb = static_cast<cles::verb>(added.verb);
    const auto what = std::string{to_string(verb)} + " '" + name + "'";
    const bool quick = (added.flags & CLES_TASK_INLINE_OK) != 0;
    if (verb != verb::bind && added.start == nullptr) {
        return refuse(CLES_BAD_TASK, what + " has no handler");
    }
    const auto same = [&](const auto& t) { return t->what.verb == verb && t->what.task == name; };
    if (std::any_of(tasks_.begin(), tasks_.end(), same)) {
        return refuse(CLES_TASK_EXISTS, what + " is added twice");
    }
    if (const auto by = (*taken_)(verb, name)) {
        return refuse(CLES_TASK_EXISTS, what + " is offered by " + *by + " already");
    }
    task_info info{.description = std::string{view_of(added.description)},
                   .idempotent = (added.flags & CLES_TASK_IDEMPOTENT) != 0,
                   .inline_ok = quick};
    for (std::size_t i = 0; i < added.parameter_count; ++i) {
        info.parameters.emplace_back(view_of(added.parameters[i]));
    }
    tasks_.push_back(std::make_unique<task>(
        task{this, {.verb = verb, .task = name, .info = std::move(info)}, added.start, added.user}));
    return CLES_ADDED;
}

std::vector<registration> loaded_plugin::tasks() const {
    std::vector<registration> out;
    for (const auto& t : tasks_) {
        auto entry = t->what;
        if (t->start != nullptr) { // none: a task that is only to be bound
            entry.async = [t = t.get()](const request& what, const responder& answer) { t->of->run(*t, what, answer); };
        }
        out.push_back(std::move(entry));
    }
    return out;
}

void loaded_plugin::stop() noexcept {
    if (stopped_) {
        return;
    }
    if (description_.stop != nullptr) {
        try {
            description_.stop();
        } catch (...) {
            say(log_level::warning, "its stop threw");
        }
    }
    stopped_ = true;
}

// -- its tasks -----------------------------------------------------------------------------------------------------

void loaded_plugin::refuse_job() const {
    if (closed_) {
        throw error(errc::unavailable, "the plugin '" + name_ + "' has stopped");
    }
    throw error(errc::busy, "as many jobs of plugins run as may");
}

void loaded_plugin::run(const task& t, const request& what, const responder& answer) {
    if (closed_) {
        refuse_job();
    }
    const auto job = jobs_.open(answer);
    if (job == 0) {
        refuse_job();
    }
    if (!answer.is_thread_safe()) { // others are told by their pool
        answer.on_stop([this, job] {
            if (const auto wanted = jobs_.stop(job)) {
                call_elsewhere(wanted);
            }
        });
    }
    call_start(t, what, job);
    jobs_.started(job);
}

void loaded_plugin::call_start(const task& t, const request& what, plugin_jobs::id job) const {
    std::array<cles_text, most_parameters> parameters{};
    const auto given = what.parameters();
    const auto count = std::min(given.size(), parameters.size());
    std::transform(given.begin(), given.begin() + static_cast<std::ptrdiff_t>(count), parameters.begin(), abi_text);
    const auto& peer = what.peer();
    const bool has_deadline = what.deadline() != time_point{};
    const auto left = std::chrono::nanoseconds{what.deadline() - time_point::clock::now()}.count();
    const cles_request asked{.size = sizeof(cles_request),
                             .verb = static_cast<std::uint32_t>(what.verb()),
                             .node = abi_text(what.node()),
                             .task = abi_text(what.task()),
                             .parameters = parameters.data(),
                             .parameter_count = count,
                             .body = abi_text(what.body()),
                             .left_ns = has_deadline ? std::max<std::int64_t>(left, 1) : 0,
                             .peer_transport = abi_text(peer.transport),
                             .peer_address = abi_text(peer.address),
                             .peer_name = abi_text(peer.name),
                             .peer_uid = peer.uid ? static_cast<std::int64_t>(*peer.uid) : -1,
                             .peer_local = peer.local ? 1 : 0,
                             .reserved = 0};
    const auto threw = [&](const std::string& how) {
        say(log_level::error, std::string{what.task()} + ": its handler threw " + how + " out of the plugin");
        jobs_.finish(job, [](const responder& to) { to.fail(errc::failed, "the handler failed"); });
    };
    try {
        t.start(t.user, job, &asked);
    } catch (const std::exception& e) {
        threw(std::string{"'"} + e.what() + "'");
    } catch (...) {
        threw("something");
    }
}

void loaded_plugin::delegate(plugin_jobs::id job, std::string_view command, const cles_ask& ask) {
    const auto question = std::make_shared<plugin_question>(
        ask, [this](std::function<void()> answer) { call_elsewhere(std::move(answer)); });
    auto options = call_options{}.urgent(ask.urgent != 0).at(view_of(ask.at));
    if (ask.deadline_ms > 0) {
        options.deadline(std::chrono::milliseconds{ask.deadline_ms});
    }
    if (ask.progress != nullptr) {
        options.on_progress([question](double fraction, std::string_view json) { question->report(fraction, json); });
    }
    const bool sent = jobs_.use(job, [text = std::string{command}, options, question](const responder& by) {
        by.delegate(text, options,
                    [question](boost::system::error_code code, std::string_view json, std::string_view message) {
                        question->answer(code, json, message);
                    });
    });
    if (!sent) {
        question->answer(errc::cancelled, "{}", "nobody waits for the job that asks");
    } else if (question.use_count() == 1) { // nobody is left who could answer
        question->answer(errc::unavailable, "{}", "the node has stopped");
    }
    question->asked();
}

// The plugin's code may take its time, or hold a lock that this thread has.
void loaded_plugin::call_elsewhere(std::function<void()> callback) {
    const auto shared = std::make_shared<const std::function<void()>>(std::move(callback));
    if (!notifier_.notify({.callback = [shared] { (*shared)(); },
                           .log = [this](log_level level, const std::string& text) { say(level, text); }})) {
        std::thread{[shared] { (*shared)(); }}.detach(); // the host has stopped
    }
}

} // namespace cles::runtime
