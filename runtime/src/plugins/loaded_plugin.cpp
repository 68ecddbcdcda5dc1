// SPDX-License-Identifier: BSL-1.0
#include "plugins/loaded_plugin.hpp"

#include <cles/call_options.hpp>
#include <cles/plugin_text.hpp>
#include <cles/schema.hpp>

#include "jobs/job_record.hpp"
#include "plugins/plugin_jobs.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <exception>
#include <memory>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

namespace cles::runtime {
namespace {

using detail::abi_text;
using detail::known_part;
using detail::view_of;

constexpr std::size_t max_parameters = 32; // of a request (docs/protocol.md)

void send_answer(const responder& to, std::string_view json) {
    if (json.empty()) {
        to.done();
        return;
    }
    try {
        std::string checked; // the only check of a result: what follows trusts it
        json_writer writer{checked};
        detail::write_text(writer, json);
        to.done(compact_json{checked});
    } catch (...) {
        to.fail(errc::failed, "the plugin's answer is not JSON");
    }
}

log_level level_of(std::uint32_t level) {
    return static_cast<log_level>(std::min(level, CLES_LOG_ERROR)); // a newer plugin may use a higher one
}

} // namespace

// -- the functions of the host -------------------------------------------------------------------------------------

// They must not throw.
struct loaded_plugin::host_api {
    static loaded_plugin& self(const cles_host* host) noexcept {
        return *reinterpret_cast<const host_functions*>(host)->plugin; // NOLINT(*-reinterpret-cast): its first member
    }

    static std::int32_t add_task(const cles_host* host, const cles_task* task) noexcept {
        try {
            return self(host).add_task(known_part(task));
        } catch (...) {
            return CLES_BAD_TASK;
        }
    }
    static void refuse(const cles_host* host, cles_text why) noexcept {
        self(host).note_refusal({.why = std::string{view_of(why)}});
    }
    static void refuse_setting(const cles_host* host, cles_text key, cles_text why) noexcept {
        const std::string setting{view_of(key)}; // empty: all of them together
        self(host).note_refusal(
            {.why = std::string{view_of(why)}, .key = setting.empty() ? "config" : "config." + setting});
    }
    static void publish(const cles_host* host, cles_text noun, cles_text json) noexcept {
        auto& plugin = self(host);
        try {
            plugin.updates_->update(view_of(noun), json_text{std::string{view_of(json)}});
        } catch (const error& e) {
            plugin.log(log_level::warning,
                       "an update of '" + std::string{view_of(noun)} + "' is not valid JSON: " + e.message());
        } catch (...) { // no memory
        }
    }
    static void log(const cles_host* host, std::uint32_t level, cles_text text) noexcept {
        self(host).log(level_of(level), view_of(text));
    }

    static void done(const cles_host* host, cles_job job, cles_text json) noexcept {
        auto& plugin = self(host);
        if (const auto here = plugin.jobs_.take_if_direct(job)) {
            send_answer(*here, view_of(json));
        } else {
            plugin.finish(job, [text = std::string{view_of(json)}](const responder& to) { send_answer(to, text); });
        }
    }
    static void fail(const cles_host* host, cles_job job, cles_text code, cles_text message) noexcept {
        self(host).finish(job, [why = errc_from_wire(view_of(code)),
                                words = std::string{view_of(message)}](const responder& to) { to.fail(why, words); });
    }
    static void busy(const cles_host* host, cles_job job, cles_text message, std::uint32_t retry_ms) noexcept {
        self(host).finish(job, [words = std::string{view_of(message)}, retry_ms](const responder& to) {
            to.refuse(words, std::chrono::milliseconds{retry_ms});
        });
    }
    static std::int32_t progress(const cles_host* host, cles_job job, double fraction, cles_text json) noexcept {
        const auto report = [fraction, text = std::string{view_of(json)}](const responder& to) {
            try {
                to.progress(fraction, json_text{text.empty() ? "{}" : text});
            } catch (...) { // invalid JSON: the report is dropped
            }
        };
        auto& jobs = self(host).jobs_;
        return !jobs.stopped(job) && jobs.use(job, report) ? 1 : 0;
    }
    static std::int32_t stopped(const cles_host* host, cles_job job) noexcept {
        return self(host).jobs_.stopped(job) ? 1 : 0;
    }
    static void on_stop(const cles_host* host, cles_job job, const cles_callback* callback) noexcept {
        self(host).jobs_.on_stop(job, plugin_callback(callback->call, callback->drop, callback->user));
    }
    static void delegate(const cles_host* host, cles_job job, cles_text command, const cles_ask* ask) noexcept {
        self(host).delegate(job, view_of(command), known_part(ask));
    }
    static void job_log(const cles_host* host, cles_job job, std::uint32_t level, cles_text text) noexcept {
        auto& plugin = self(host);
        const auto how = level_of(level);
        const auto line = plugin.name_ + ": " + std::string{view_of(text)};
        if (!plugin.jobs_.use(job, [how, line](const responder& to) { to.log(how, line); })) {
            plugin.log(how, view_of(text));
        }
    }
    static cles_feed bind(const cles_host* host, cles_job job, cles_text noun, const cles_bind* how) noexcept {
        return self(host).bind(job, view_of(noun), known_part(how));
    }
    static void next(const cles_host* host, cles_feed feed, const cles_next* wanted) noexcept {
        self(host).next(feed, known_part(wanted));
    }
    static void unbind(const cles_host* host, cles_feed feed) noexcept { self(host).feeds_.remove(feed); }
};

loaded_plugin::loaded_plugin(const cles_plugin& description, std::string node, plugin_jobs& jobs,
                             stop_notifier& notifier, plugin_log log)
    : description_(description), name_(view_of(description.name)), version_(view_of(description.version)),
      node_(std::move(node)), jobs_(jobs), notifier_(notifier),
      log_(std::move(log)), host_{.functions = {.size = sizeof(cles_host),
                                                .abi_minor = CLES_PLUGIN_ABI_MINOR,
                                                .node = abi_text(node_),
                                                .add_task = &host_api::add_task,
                                                .refuse = &host_api::refuse,
                                                .publish = &host_api::publish,
                                                .log = &host_api::log,
                                                .done = &host_api::done,
                                                .fail = &host_api::fail,
                                                .busy = &host_api::busy,
                                                .progress = &host_api::progress,
                                                .stopped = &host_api::stopped,
                                                .on_stop = &host_api::on_stop,
                                                .delegate = &host_api::delegate,
                                                .job_log = &host_api::job_log,
                                                .refuse_setting = &host_api::refuse_setting,
                                                .bind = &host_api::bind,
                                                .next = &host_api::next,
                                                .unbind = &host_api::unbind},
                                  .plugin = this} {}

void loaded_plugin::log(log_level level, std::string_view text) const {
    const std::scoped_lock lock{log_mutex_};
    if (log_) {
        log_(level, name_, text);
    }
}

void loaded_plugin::disable_log() noexcept {
    const std::scoped_lock lock{log_mutex_};
    log_ = nullptr;
}

void loaded_plugin::finish(plugin_jobs::id job, std::function<void(const responder&)> answer) {
    if (!jobs_.finish(job, std::move(answer)) && !closed_ && !unknown_job_reported_.exchange(true)) {
        log(log_level::warning, "answered a job that does not exist or has been answered (logged once)");
    }
}

// -- start and stop ------------------------------------------------------------------------------------------------

// Calls a function of the plugin that returns 0, or reports a reason and returns something else.
template <class F>
std::optional<loaded_plugin::refusal> loaded_plugin::run_guarded(const char* what, F&& call) {
    may_refuse_ = true;
    bool ok = false;
    try {
        ok = call() == 0;
    } catch (const std::exception& e) {
        refusal_ = {.why = std::string{what} + " threw: " + e.what()};
    } catch (...) {
        refusal_ = {.why = std::string{what} + " threw something that is not an exception"};
    }
    may_refuse_ = false;
    if (ok) {
        return std::nullopt;
    }
    if (refusal_.why.empty()) {
        refusal_.why = "it refuses to start without giving a reason";
    }
    return refusal_;
}

// The first one counts.
void loaded_plugin::note_refusal(refusal what) {
    if (may_refuse_ && refusal_.why.empty()) {
        refusal_ = std::move(what);
    }
}

std::optional<loaded_plugin::refusal> loaded_plugin::check(const std::string& config) {
    if (description_.check == nullptr) {
        return std::nullopt;
    }
    return run_guarded("its settings check", [&] { return description_.check(&host_.functions, abi_text(config)); });
}

std::optional<loaded_plugin::refusal> loaded_plugin::start(const std::string& config, publisher updates,
                                                           const owner_lookup& owner_of) {
    updates_ = std::move(updates);
    owner_of_ = &owner_of;
    auto refused = run_guarded("its start", [&] { return description_.start(&host_.functions, abi_text(config)); });
    owner_of_ = nullptr;
    if (refused) {
        closed_ = true;
        return refused;
    }
    stopped_ = false;
    if (!refusal_.why.empty()) {
        log(log_level::warning, "continues without a task: " + refusal_.why);
    }
    return std::nullopt;
}

std::int32_t loaded_plugin::add_task(const cles_task& added) {
    if (owner_of_ == nullptr) {
        return CLES_TOO_LATE;
    }
    const auto refuse = [&](std::int32_t code, std::string why) {
        note_refusal({.why = std::move(why)});
        return code;
    };
    const std::string name{view_of(added.name)};
    if (added.verb >= verb_count) {
        return refuse(CLES_BAD_TASK, "'" + name + "' has an invalid verb");
    }
    const auto verb = static_cast<cles::verb>(added.verb);
    const auto what = std::string{to_string(verb)} + " '" + name + "'";
    if (verb != verb::bind && added.start == nullptr) {
        return refuse(CLES_BAD_TASK, what + " has no handler");
    }
    const auto same = [&](const auto& t) { return t.verb == verb && t.task == name; };
    if (std::any_of(tasks_.begin(), tasks_.end(), same)) {
        return refuse(CLES_TASK_EXISTS, what + " is added twice");
    }
    if (const auto owner = (*owner_of_)(verb, name)) {
        return refuse(CLES_TASK_EXISTS, what + " is already provided by " + *owner);
    }
    registration task{.verb = verb,
                      .task = name,
                      .info = {.description = std::string{view_of(added.description)},
                               .idempotent = (added.flags & CLES_TASK_IDEMPOTENT) != 0,
                               .inline_ok = (added.flags & CLES_TASK_INLINE_OK) != 0,
                               .local = (added.flags & CLES_TASK_LOCAL) != 0,
                               .must_be_signed = (added.flags & CLES_TASK_SIGNED) != 0}};
    if (const auto types = view_of(added.types); !types.empty()) {
        try {
            task.info.types = task_types(read_task_types(types));
        } catch (const error& e) {
            return refuse(CLES_BAD_TASK, what + ": " + e.message());
        }
    }
    for (std::size_t i = 0; i < added.parameter_count; ++i) {
        task.info.parameters.emplace_back(view_of(added.parameters[i]));
    }
    if (added.start != nullptr) { // without a handler it can only be bound
        task.async = [this, handler = added.start, user = added.user](const request& r, const responder& answer) {
            run(handler, user, r, answer);
        };
    }
    tasks_.push_back(std::move(task));
    return CLES_ADDED;
}

void loaded_plugin::stop() noexcept {
    if (stopped_) {
        return;
    }
    if (description_.stop != nullptr) {
        try {
            description_.stop();
        } catch (...) {
            log(log_level::warning, "its stop threw");
        }
    }
    stopped_ = true;
}

// -- tasks ---------------------------------------------------------------------------------------------------------

void loaded_plugin::run(task_handler handler, void* user, const request& what, const responder& answer) {
    const auto job = closed_ ? plugin_jobs::id{0} : jobs_.open(answer);
    if (job == 0) {
        throw closed_ ? error(errc::unavailable, "the plugin '" + name_ + "' has stopped")
                      : error(errc::busy, "too many jobs of plugins are running");
    }
    if (!answer.is_thread_safe()) { // a pool tells its own jobs
        answer.on_stop([this, job] {
            if (const auto wanted = jobs_.stop(job)) {
                call_on_other_thread(wanted);
            }
        });
    }
    plugin_turn turn{job};
    call_handler(handler, user, what, job);
    jobs_.started(job);
}

void loaded_plugin::call_handler(task_handler handler, void* user, const request& what, plugin_jobs::id job) const {
    std::array<cles_text, max_parameters> parameters{};
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
                             .reserved = 0,
                             .trace = abi_text(what.trace()),
                             .requester = abi_text(what.requester()),
                             .forwarded_by = abi_text(what.forwarded_by())};
    const auto report_exception = [&](const std::string& how) {
        log(log_level::error, std::string{what.task()} + ": its handler threw " + how + " out of the plugin");
        jobs_.finish(job, [](const responder& to) { to.fail(errc::failed, "the handler failed"); });
    };
    try {
        handler(user, job, &asked);
    } catch (const std::exception& e) {
        report_exception(std::string{"'"} + e.what() + "'");
    } catch (...) {
        report_exception("something");
    }
}

void loaded_plugin::delegate(plugin_jobs::id job, std::string_view command, const cles_ask& ask) {
    const auto request = std::make_shared<plugin_request>(
        ask, job, [this, job](std::function<void()> answer) { call_after(job, std::move(answer)); });
    auto options = call_options{}.urgent(ask.urgent != 0).at(view_of(ask.at)).hops(detail::hops_from(ask.hops));
    if (ask.deadline_ms > 0) {
        options.deadline(std::chrono::milliseconds{ask.deadline_ms});
    }
    if (ask.progress != nullptr) {
        options.on_progress(
            [request](double fraction, std::string_view json) { request->report_progress(fraction, json); });
    }
    const bool sent = jobs_.use(job, [text = std::string{command}, options, request](const responder& by) {
        by.delegate(text, options,
                    [request](boost::system::error_code code, std::string_view json, std::string_view message) {
                        request->complete(code, json, message);
                    });
    });
    if (!sent) {
        request->complete(errc::cancelled, "{}", "the requester of the job no longer waits");
    } else if (request.use_count() == 1) { // nothing can answer it any more
        request->complete(errc::unavailable, "{}", "the node has stopped");
    }
    request->sent();
}

plugin_feeds::id loaded_plugin::bind(plugin_jobs::id job, std::string_view noun, const cles_bind& how) {
    const auto by = jobs_.find_shared(job);
    if (!by) {
        const bool runs_inline = !jobs_.stopped(job);
        return feeds_.add({.feed = {},
                           .job = job,
                           .why = runs_inline ? errc::failed : errc::cancelled,
                           .words = runs_inline ? "a job on the I/O thread has no feeds"
                                                : "the requester of the job no longer waits"});
    }
    bind_options options;
    options.at(view_of(how.at)).keep(how.keep).every(std::chrono::milliseconds{how.every_ms});
    options.deadline(std::chrono::milliseconds{how.deadline_ms}).hops(detail::hops_from(how.hops)).mark(how.mark != 0);
    return feeds_.add({.feed = by->bind(noun, options), .job = job});
}

void loaded_plugin::next(plugin_feeds::id feed, const cles_next& wanted) {
    const auto found = feeds_.find(feed);
    // Whose feed it was is not known any more, but only the job itself has the handle.
    const auto job = found.job == 0 && feeds_.has_existed(feed) ? plugin_turn::current_job() : found.job;
    const auto waiting = std::make_shared<plugin_next>(
        wanted, job, [this, job](std::function<void()> answer) { call_after(job, std::move(answer)); });
    if (found.feed.is_open()) {
        found.feed.next([this, feed, waiting](boost::system::error_code code, const job_event& what) {
            if (code && code != errc::busy) {
                feeds_.remove(feed);
            }
            waiting->complete(code, what);
        });
    } else {
        feeds_.remove(feed);
        waiting->complete(found.why, {.text = found.words});
    }
    waiting->sent();
}

// Not beside the job's other code: on the I/O thread, too, if that runs there, as its other callbacks do.
void loaded_plugin::call_after(plugin_jobs::id job, std::function<void()> callback) {
    if (job != 0 && job == plugin_turn::current_job()) {
        plugin_turn::call_at_end(std::move(callback),
                                 [this](std::function<void()> rest) { call_on_other_thread(std::move(rest)); });
    } else {
        call_on_other_thread(std::move(callback));
    }
}

// Not here, because the plugin's code may take long, or wait for a lock that this thread holds.
void loaded_plugin::call_on_other_thread(std::function<void()> callback) {
    const auto shared = std::make_shared<const std::function<void()>>(std::move(callback));
    if (!notifier_.notify({.callback = [shared] { (*shared)(); },
                           .log = [this](log_level level, const std::string& text) { log(level, text); }})) {
        try { // the host has stopped
            std::thread{[shared] { (*shared)(); }}.detach();
        } catch (const std::system_error& e) { // so the plugin will never know, but the process is about to end
            log(log_level::error, std::string{"no thread for a callback after the end: "} + e.code().message());
        }
    }
}

} // namespace cles::runtime
