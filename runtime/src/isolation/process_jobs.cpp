// SPDX-License-Identifier: BSL-1.0
#include "isolation/process_jobs.hpp"

#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>
#include <cles/limits.hpp>

#include "isolation/descriptor.hpp"
#include "isolation/plugin_messages.hpp"

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

std::uint64_t control_connection::lines_sent_by_this_thread() noexcept { return lines_sent; }

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
        jobs_.forget(id_);
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
            answer(failure_body(wire_name(code), message, std::nullopt));
        }
    }
    void refuse(std::string_view message, std::chrono::milliseconds retry) override {
        if (!answered_.exchange(true)) {
            answer(failure_body(wire_name(errc::busy), message, retry.count()));
        }
    }
    bool progress(double fraction, std::string_view json) override {
        if (stopped_ || answered_ || progress_unwanted_) {
            return false;
        }
        std::string number;
        json_writer{number}.value(std::isnan(fraction) ? 0 : fraction);
        std::string line;
        wire_line_writer{line, id_}.adverb("progress", number).body(json);
        jobs_.daemon_.say(line);
        return true;
    }
    void on_stop(std::function<void()> callback) override {
        {
            const std::scoped_lock lock{mutex_};
            if (!stopped_) {
                on_stop_.swap(callback);
                return;
            }
        }
        if (callback) {
            callback();
        }
    }
    [[nodiscard]] bool stopped() const noexcept override { return stopped_; }
    void delegate(std::string_view command, const call_options& options, answer_callback answered) override {
        const auto ticket =
            jobs_.open_request(std::make_shared<asked>(asked{std::move(answered), options.on_progress_}));
        std::string line;
        wire_line_writer{line, verb::delegate, control_task}.parameter("ask").parameter(id_).parameter(ticket).body(
            ask_message{.command = std::string{command},
                        .at = options.at_,
                        .urgent = options.urgent_,
                        .hops = options.hops_,
                        .deadline_ms = options.deadline_.count(),
                        .progress = options.on_progress_ != nullptr});
        jobs_.daemon_.say(line);
    }
    void log(log_level level, std::string_view text) override {
        std::string line;
        wire_line_writer{line, verb::push, control_task}.parameter("log").parameter(id_).body(
            log_message{static_cast<std::uint32_t>(level), std::string{text.substr(0, max_log_text)}});
        jobs_.daemon_.say(line);
    }
    [[nodiscard]] bool is_thread_safe() const noexcept override { return true; }

    /// The handler begins on this thread.
    void begin() noexcept {
        current = this;
        sent_before_ = control_connection::lines_sent_by_this_thread();
    }
    /// The handler has returned. Returns its reply, if it goes over the lane: not if what it has logged after that has
    /// to be read before the job ends.
    std::optional<std::string> end() {
        current = nullptr;
        if (traced_ && direct_ && sent_before_ != control_connection::lines_sent_by_this_thread()) {
            std::string line;
            wire_line_writer{line, id_}.body(*std::exchange(direct_, std::nullopt));
            jobs_.daemon_.say(line);
        }
        return std::move(direct_);
    }
    /// The requester waits no more. Returns the callback, to be called on a thread where it may take long.
    std::function<void()> stop() {
        const std::scoped_lock lock{mutex_};
        stopped_ = true;
        return std::exchange(on_stop_, nullptr);
    }
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
            std::string line;
            wire_line_writer{line, id_}.body(body);
            jobs_.daemon_.say(line);
        }
        std::function<void()> dropped; // a job that has answered is not told to stop any more
        const std::scoped_lock lock{mutex_};
        dropped.swap(on_stop_);
    }

    process_jobs& jobs_;
    const std::uint64_t id_;
    const bool traced_;
    std::atomic<bool> answered_{false};
    std::atomic<bool> stopped_{false};
    std::atomic<bool> progress_unwanted_{false};
    std::uint64_t sent_before_ = 0;
    std::optional<std::string> direct_{};
    std::mutex mutex_;
    std::function<void()> on_stop_{};
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
    std::string reply;
    wire_line_writer writer{reply, line.id};
    if (direct) {
        writer.body(*direct);
    } else {
        writer.adverb("later", "yes").body("{}");
    }
    return reply;
}

void process_jobs::resume(const wire_line& line) {
    const auto ticket = line.number_at(1);
    std::shared_ptr<asked> request;
    {
        const std::scoped_lock lock{mutex_};
        if (const auto found = requests_.find(ticket); found != requests_.end()) {
            request = found->second;
        }
    }
    if (!request) {
        return;
    }
    if (line.parameters.front() == "reported") {
        double fraction = 0;
        if (request->progress && json_reader{line.adverb("progress")}.read(fraction)) {
            request->progress(fraction, line.body);
        }
        return;
    }
    close_request(ticket);
    const auto code = line.adverb("code");
    request->answered(code.empty() ? boost::system::error_code{} : errc_from_wire(code), line.body,
                      line.adverb("message"));
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
        notifier_.notify({.callback = std::move(callback), .log = [this](log_level level, const std::string& text) {
                              std::string line;
                              wire_line_writer{line, verb::push, control_task}.parameter("log").body(
                                  log_message{static_cast<std::uint32_t>(level), text});
                              daemon_.say(line);
                          }});
    }
}

void process_jobs::progress_unwanted(std::uint64_t id) {
    const std::scoped_lock lock{mutex_};
    if (const auto found = calls_.find(id); found != calls_.end()) {
        found->second->set_progress_unwanted();
    }
}

void process_jobs::resume_on_notifier(const wire_line& line) {
    // The copy's views are of its own text.
    const auto kept = std::make_shared<wire_line>(line);
    const auto text = std::make_shared<std::string>(line.body);
    kept->body = *text;
    kept->adverbs.clear();
    static constexpr std::string_view keys[] = {"code", "message", "progress"};
    for (const auto key : keys) {
        if (const auto value = line.adverb(key); !value.empty()) {
            kept->adverbs.emplace_back(key, std::string{value});
        }
    }
    notifier_.notify({.callback = [this, kept, text] { resume(*kept); }});
}

// -- the tables ----------------------------------------------------------------------------------------------------

std::uint64_t process_jobs::open_request(std::shared_ptr<asked> what) {
    const std::scoped_lock lock{mutex_};
    requests_.emplace(++last_ticket_, std::move(what));
    return last_ticket_;
}

void process_jobs::close_request(std::uint64_t ticket) {
    const std::scoped_lock lock{mutex_};
    requests_.erase(ticket);
}

void process_jobs::forget(std::uint64_t id) {
    const std::scoped_lock lock{mutex_};
    calls_.erase(id);
}

} // namespace cles::runtime
