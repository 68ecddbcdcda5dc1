// SPDX-License-Identifier: BSL-1.0
#include "isolation/process_jobs.hpp"

#include <cles/convert.hpp>
#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/limits.hpp>

#include "isolation/descriptor.hpp"
#include "isolation/plugin_messages.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <optional>
#include <vector>

#include <unistd.h>

namespace cles::runtime {
namespace {

constexpr std::size_t max_cancelled_early = 256;

thread_local std::uint64_t lines_sent = 0;

identity peer_of(const wire_line& line) {
    identity peer{.transport = std::string{line.adverb("transport")},
                  .address = std::string{line.adverb("address")},
                  .name = std::string{line.adverb("name")},
                  .uid = std::nullopt,
                  .local = line.number("local").value_or(0) != 0};
    if (const auto uid = line.number("uid")) {
        peer.uid = static_cast<std::uint32_t>(*uid);
    }
    return peer;
}

} // namespace

void control_connection::say(std::string_view lines) {
    ++lines_sent;
    const std::scoped_lock lock{mutex_};
    if (send_all(socket_, lines) != 0) {
        ::_exit(0); // the daemon has ended
    }
}

void control_connection::log(log_level level, std::string_view text, std::uint64_t job) {
    wire_line_writer line{verb::push, control_task};
    line.parameter("log");
    if (job != 0) {
        line.parameter(job);
    }
    say(line.body(log_message{static_cast<std::uint32_t>(level), std::string{text}}));
}

std::uint64_t control_connection::lines_sent_by_this_thread() noexcept { return lines_sent; }

std::uint64_t process_jobs::add_request(asked what) {
    const auto request = std::make_shared<asked>(std::move(what));
    const std::scoped_lock lock{mutex_};
    requests_.emplace(++last_ticket_, request);
    return last_ticket_;
}

// -- a feed --------------------------------------------------------------------------------------------------------

class process_jobs::feed final : public detail::job_feed_control {
  public:
    feed(process_jobs& jobs, std::uint64_t job, std::uint64_t number) noexcept
        : jobs_(jobs), job_(job), number_(number) {}

    void next(event_callback taken) override {
        const auto ticket = jobs_.add_request({.job = job_, .answered = {}, .event = std::move(taken)});
        jobs_.daemon_.say(line("next").parameter(ticket).body("{}"));
    }
    void close() noexcept override { jobs_.daemon_.say(line("unbind").body("{}")); }

    /// A line about it.
    [[nodiscard]] wire_line_writer line(std::string_view what) const {
        wire_line_writer out{verb::push, control_task};
        out.parameter(what).parameter(job_).parameter(number_);
        return out;
    }

  private:
    process_jobs& jobs_;
    const std::uint64_t job_;
    const std::uint64_t number_;
};

// -- a job ---------------------------------------------------------------------------------------------------------

// The responder of a job. Unless its handler has said something before, which the daemon has to read first, a reply
// from inside the handler goes over the handler's lane.
class process_jobs::call final : public detail::call_control {
  public:
    call(process_jobs& jobs, std::uint64_t id, bool traced) noexcept : jobs_(jobs), id_(id), traced_(traced) {}
    call(const call&) = delete;
    call& operator=(const call&) = delete;
    ~call() override {
        if (!answered_) {
            call::fail(errc::failed, "the job ended without an answer");
        }
        const std::scoped_lock lock{jobs_.mutex_};
        jobs_.calls_.erase(id_);
    }

    void done(std::string_view json) override {
        if (json.starts_with(R"({"error":)")) {
            fail(errc::failed, "the result's first key is 'error'");
        } else if (!answered_.exchange(true)) {
            answer(reply_body(json));
        }
    }
    void fail(errc code, std::string_view message) override {
        if (!answered_.exchange(true)) {
            answer(failure_body({std::string{wire_name(code)}, std::string{message}}));
        }
    }
    void refuse(std::string_view message, std::chrono::milliseconds retry) override {
        if (!answered_.exchange(true)) {
            answer(failure_body({std::string{wire_name(errc::busy)}, std::string{message}, retry.count()}));
        }
    }
    bool progress(double fraction, std::string_view json) override {
        if (stopped() || answered_ || progress_unwanted_) {
            return false;
        }
        const auto number = to_json(std::isnan(fraction) ? 0 : fraction);
        jobs_.daemon_.say(wire_line_writer{id_}.adverb("progress", number).body(json));
        return true;
    }
    void on_stop(std::function<void()> callback) override { on_stop_.set(std::move(callback)); }
    [[nodiscard]] bool stopped() const noexcept override { return on_stop_.stopped(); }
    void delegate(std::string_view command, const call_options& options, answer_callback answered) override {
        const auto ticket =
            jobs_.add_request({.job = id_, .answered = std::move(answered), .progress = options.on_progress_});
        const ask_message wanted{.command = std::string{command},
                                 .at = options.at_,
                                 .urgent = options.urgent_,
                                 .hops = options.hops_,
                                 .deadline_ms = options.deadline_.count(),
                                 .progress = options.on_progress_ != nullptr};
        jobs_.daemon_.say(
            wire_line_writer{verb::delegate, control_task}.parameter("ask").parameter(id_).parameter(ticket).body(
                wanted));
    }
    std::shared_ptr<detail::job_feed_control> bind(detail::job_feed_maker /*make*/, std::string_view noun,
                                                   const bind_options& options) override {
        std::uint64_t number = 0;
        {
            const std::scoped_lock lock{jobs_.mutex_};
            number = ++jobs_.last_feed_;
        }
        auto made = std::make_shared<feed>(jobs_, id_, number);
        const bind_message wanted{.noun = std::string{noun},
                                  .at = options.at_,
                                  .keep = options.keep_,
                                  .every_ms = options.every_.count(),
                                  .hops = options.hops_,
                                  .deadline_ms = options.deadline_.count(),
                                  .mark = options.mark_};
        jobs_.daemon_.say(made->line("bind").body(wanted));
        return made;
    }
    void log(log_level level, std::string_view text) override {
        jobs_.daemon_.log(level, text.substr(0, max_log_text), id_);
    }
    [[nodiscard]] bool is_thread_safe() const noexcept override { return true; }

    /// The handler begins on this thread.
    void begin() noexcept {
        current = this;
        sent_before_ = control_connection::lines_sent_by_this_thread();
    }
    /// The handler has returned. Returns its reply, if it goes over the lane: not if it has said something after that,
    /// which is to be read before the job ends, and to which an answer may come that the requester must not wait for.
    std::optional<std::string> end() {
        current = nullptr;
        if (direct_ && sent_before_ != control_connection::lines_sent_by_this_thread()) {
            jobs_.daemon_.say(wire_line_writer{id_}.body(*std::exchange(direct_, std::nullopt)));
        }
        return std::move(direct_);
    }
    /// The requester waits no more. Returns the callback, to be called on a thread where it may take long.
    std::function<void()> stop() { return on_stop_.stop(); }
    void set_progress_unwanted() noexcept { progress_unwanted_ = true; }

    [[nodiscard]] static std::uint64_t traced_here() noexcept {
        return current != nullptr && current->traced_ ? current->id_ : 0;
    }

  private:
    static thread_local const call* current;

    void answer(std::string body) {
        if (current == this && sent_before_ == control_connection::lines_sent_by_this_thread()) {
            direct_ = std::move(body);
        } else {
            jobs_.daemon_.say(wire_line_writer{id_}.body(body));
        }
        on_stop_.drop();
    }

    process_jobs& jobs_;
    const std::uint64_t id_;
    const bool traced_;
    std::atomic<bool> answered_{false};
    std::atomic<bool> progress_unwanted_{false};
    std::uint64_t sent_before_ = 0;
    std::optional<std::string> direct_{};
    stop_callback on_stop_;
};

thread_local const process_jobs::call* process_jobs::call::current = nullptr;

std::uint64_t process_jobs::traced_here() noexcept { return call::traced_here(); }

// -- on lanes ------------------------------------------------------------------------------------------------------

void process_jobs::add(registration task) {
    if (task.async) {
        tasks_.emplace(std::pair{task.verb, task.task}, std::move(task.async));
    }
}

std::string process_jobs::serve(const wire_line& line, std::string_view node) {
    const auto trace = line.adverb("trace");
    const auto handled = std::make_shared<call>(*this, line.id, !trace.empty());
    {
        const std::scoped_lock lock{mutex_};
        calls_.emplace(line.id, handled.get());
        turns_.try_emplace(line.id);
        if (std::erase(cancelled_early_, line.id) != 0) {
            handled->stop();
        }
    }
    const auto peer = peer_of(line);
    const std::vector<std::string_view> parameters(line.parameters.begin(), line.parameters.end());
    const auto due = line.number("due");
    const detail::request_data data{
        .verb = line.verb,
        .node = node,
        .task = line.task,
        .parameters = parameters,
        .body = line.body,
        .peer = &peer,
        .deadline = due ? time_point{time_point::duration{*due}} : time_point{},
        .trace = trace,
        .requester = line.adverb("requester"),
        .forwarded_by = line.adverb("forwarder"),
    };
    handled->begin();
    try {
        const auto found = tasks_.find(std::pair{line.verb, std::string{line.task}});
        if (found == tasks_.end()) {
            throw error(errc::no_task, "the plugin has no such task any more");
        }
        found->second(request{data}, responder{handled});
    } catch (...) {
        detail::fail_with(*handled, std::current_exception());
    }
    const auto direct = handled->end();
    end_turn(line.id);
    wire_line_writer reply{line.id};
    return direct ? reply.body(*direct) : reply.adverb("later", "yes").body("{}");
}

void process_jobs::resume(const wire_line& line, std::string_view text) {
    std::shared_ptr<asked> request;
    {
        const std::scoped_lock lock{mutex_};
        const auto found = requests_.find(line.number_at(1));
        if (found == requests_.end()) {
            return;
        }
        request = found->second;
        if (line.parameters.front() != "reported") {
            requests_.erase(found);
        }
        const auto [turn, is_first] = turns_.try_emplace(request->job);
        if (!is_first) { // what is read from a line are views of it, so it is read again then
            turn->second.emplace_back(
                [this, request, kept = std::string{text}] { deliver(*request, read_wire_line(kept).value()); });
            return;
        }
    }
    deliver(*request, line);
    end_turn(request->job);
}

// The job's code has returned.
void process_jobs::end_turn(std::uint64_t job) {
    for (;;) {
        std::vector<std::function<void()>> next;
        {
            const std::scoped_lock lock{mutex_};
            const auto turn = turns_.find(job);
            next.swap(turn->second);
            if (next.empty()) {
                turns_.erase(turn);
                return;
            }
        }
        for (const auto& each : next) {
            each();
        }
    }
}

void process_jobs::deliver(const asked& request, const wire_line& line) {
    try {
        run_callback(request, line);
    } catch (const std::exception& e) {
        daemon_.log(log_level::error, std::string{"a callback threw: "} + e.what());
    } catch (...) {
        daemon_.log(log_level::error, "a callback threw");
    }
}

void process_jobs::run_callback(const asked& request, const wire_line& line) {
    if (line.parameters.front() == "reported") {
        double fraction = 0;
        if (request.progress && json_reader{line.adverb("progress")}.read(fraction)) {
            request.progress(fraction, line.body);
        }
        return;
    }
    const auto name = line.adverb("code");
    const auto code = name.empty() ? boost::system::error_code{} : errc_from_wire(name);
    if (!request.event) {
        request.answered(code, line.body, line.adverb("message"));
        return;
    }
    const auto kind = std::ranges::find(event_names, line.adverb("event")) - event_names.begin();
    const auto number = [&line](std::string_view key) {
        return static_cast<std::uint64_t>(line.number(key).value_or(0));
    };
    request.event(code, {.kind = code ? feed_event::lost : static_cast<feed_event>(kind),
                         .json = line.body,
                         .publisher = line.adverb("publisher"),
                         .seq = number("seq"),
                         .epoch = static_cast<std::uint32_t>(number("epoch")),
                         .missed = number("missed"),
                         .text = line.adverb("message"),
                         .waited = std::chrono::nanoseconds{line.number("waited").value_or(0)}});
}

// -- from the control connection -----------------------------------------------------------------------------------

void process_jobs::cancel(std::uint64_t id) {
    std::function<void()> callback;
    {
        const std::scoped_lock lock{mutex_};
        const auto found = calls_.find(id);
        if (found == calls_.end()) {
            cancelled_early_.push_back(id); // or it has ended
            if (cancelled_early_.size() > max_cancelled_early) {
                cancelled_early_.pop_front();
            }
            return;
        }
        callback = found->second->stop();
    }
    if (callback) {
        notifier_.notify({.callback = std::move(callback),
                          .log = [this](log_level level, const std::string& text) { daemon_.log(level, text); }});
    }
}

void process_jobs::progress_unwanted(std::uint64_t id) {
    const std::scoped_lock lock{mutex_};
    if (const auto found = calls_.find(id); found != calls_.end()) {
        found->second->set_progress_unwanted();
    }
}

void process_jobs::resume_on_notifier(std::string_view line) {
    // What is read from a line are views of it.
    notifier_.notify({.callback = [this, kept = std::string{line}] { resume(read_wire_line(kept).value(), kept); }});
}

} // namespace cles::runtime
