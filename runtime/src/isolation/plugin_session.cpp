// SPDX-License-Identifier: BSL-1.0
#include "isolation/plugin_session.hpp"

#include <cles/convert.hpp>
#include <cles/json_reader.hpp>

#include <boost/asio/post.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <exception>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>

namespace cles::runtime {

namespace asio = boost::asio;
using clock = time_point::clock;
using namespace std::chrono_literals;

namespace {

constexpr std::size_t max_control_read = 65536;
// What the process may leave unread. It reads at once, unless it has been stopped.
constexpr std::size_t max_pending = 64U << 20U;
constexpr std::size_t max_output_line = 1000;
constexpr std::size_t max_asks = 4096; // requests and events that its jobs may wait for
constexpr std::size_t max_feeds = 256; // of a job, of which the service binds fewer
// How long the process may take to end after it has closed a connection.
constexpr std::chrono::milliseconds end_time{100};

// How often jobs are examined.
std::chrono::nanoseconds watch_interval(std::chrono::nanoseconds grace) {
    return std::clamp<std::chrono::nanoseconds>(grace / 8, 2ms, 100ms);
}

std::string grace_text(std::chrono::nanoseconds span) {
    const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(span).count();
    return ms % 1000 == 0 ? std::to_string(ms / 1000) + " s" : std::to_string(ms) + " ms";
}

std::string request_line(std::uint64_t id, const request& what) {
    wire_line_writer line{what.verb(), what.task()};
    for (const auto parameter : what.parameters()) {
        line.parameter(parameter);
    }
    const auto& peer = what.peer();
    line.adverb("id", static_cast<std::int64_t>(id));
    if (what.deadline() != time_point{}) {
        line.adverb("due", std::int64_t{what.deadline().time_since_epoch().count()});
    }
    line.adverb("transport", peer.transport).adverb("address", peer.address);
    if (!peer.name.empty()) {
        line.adverb("name", peer.name);
    }
    if (peer.uid) {
        line.adverb("uid", std::int64_t{*peer.uid});
    }
    if (peer.local) {
        line.adverb("local", std::int64_t{1});
    }
    if (!what.trace().empty()) {
        line.adverb("trace", what.trace());
    }
    if (!what.requester().empty()) {
        line.adverb("requester", what.requester());
    }
    if (!what.forwarded_by().empty()) {
        line.adverb("forwarder", what.forwarded_by());
    }
    return line.body(what.body());
}

std::string job_label(const request& what) {
    return std::string{to_string(what.verb())} + " '" + std::string{what.task()} + "'";
}

} // namespace

std::chrono::nanoseconds patience_of(std::chrono::nanoseconds grace) {
    return std::max(grace - 2 * watch_interval(grace), grace / 2);
}

plugin_session::plugin_session(asio::any_io_executor executor, std::string name, session_options options,
                               session_events events)
    : executor_(std::move(executor)), options_(std::move(options)), events_(std::move(events)),
      process_(options_.plugin, options_.lanes), control_(process_.control.get()), output_(process_.output.get()),
      name_(std::move(name)), lanes_(options_.lanes) {
    for (std::size_t i = 0; i < lanes_.size(); ++i) {
        lanes_[i].socket = process_.lanes[i].get();
        free_lanes_.push_back(&lanes_[i]);
    }
}

// -- jobs, on workers ----------------------------------------------------------------------------------------------

plugin_session::lane* plugin_session::take_lane(const std::shared_ptr<const job>& by) {
    std::unique_lock lock{mutex_};
    // There are as many as workers, so one becomes free soon.
    lane_freed_.wait(lock, [this] { return !free_lanes_.empty() || ended_; });
    if (ended_) {
        return nullptr;
    }
    auto* taken = free_lanes_.back(); // the one that was used last
    free_lanes_.pop_back();
    taken->used_by = by;
    return taken;
}

void plugin_session::give_back(lane* used) {
    const std::scoped_lock lock{mutex_};
    used->used_by.reset();
    free_lanes_.push_back(used);
    lane_freed_.notify_one();
}

bool plugin_session::serve(const request& what, const responder& answer) {
    const auto until = what.deadline() == time_point{} ? time_point::max() : what.deadline();
    const auto here = std::make_shared<job>(answer, job_label(what), until);
    auto* on = take_lane(here);
    if (on == nullptr) {
        return false;
    }
    const auto id = ++last_id_;
    {
        const std::scoped_lock lock{mutex_};
        jobs_.emplace(id, here);
    }
    answer.on_stop([weak = weak_from_this(), id] {
        if (const auto self = weak.lock()) {
            self->stop(id);
        }
    });
    std::string reply;
    const auto how = exchange(*on, request_line(id, what), reply);
    if (how != exchanged::replied) {
        // Nothing else uses the lane any more.
        const bool started = how == exchanged::lost;
        if (const auto left = take(id); left && started) {
            fail(*left);
        }
        return started;
    }
    give_back(on);
    const auto read = read_wire_line(reply);
    if (!read || !read->is_reply || read->id != id) {
        kill("it sent a reply that is not one");
        if (const auto left = take(id)) {
            fail(*left);
        }
        return true;
    }
    if (!read->adverb("later").empty()) { // it has returned; what it has not answered ends with the process
        here->on_lane = false;
        if (ended_) {
            if (const auto left = take(id)) {
                fail(*left);
            }
        }
    } else if (const auto done = take(id)) {
        settle(*done, read->body);
    }
    return true;
}

// Sends a line, and waits for the line that answers it: when the handler, or the callback, has returned.
plugin_session::exchanged plugin_session::exchange(lane& on, std::string_view line, std::string& reply) {
    if (const auto code = send_all(on.socket, line); code != 0) {
        return lose(code);
    }
    for (;;) {
        if (const auto whole = on.input.next()) {
            reply = *whole;
            return exchanged::replied;
        }
        std::array<char, 4096> part; // NOLINT(*-member-init): it is written before it is read
        const auto size = ::recv(on.socket, part.data(), part.size(), 0);
        if (size > 0) {
            on.input.append({part.data(), static_cast<std::size_t>(size)});
            if (on.input.rest().size() > options_.max_line) {
                kill("it sent a line of more than " + std::to_string(options_.max_line) + " bytes");
                return lose(0);
            }
        } else if (size == 0 || errno != EINTR) {
            return lose(size == 0 ? 0 : errno);
        }
    }
}

// The process has closed a lane: it ends, or has to. An error says whether it had read what was sent.
plugin_session::exchanged plugin_session::lose(int code) {
    ended_ = true;
    process_.end();
    return code == EPIPE || code == ECONNRESET ? exchanged::unread : exchanged::lost;
}

std::shared_ptr<plugin_session::job> plugin_session::take(std::uint64_t id) {
    const std::scoped_lock lock{mutex_};
    const auto found = jobs_.find(id);
    if (found == jobs_.end()) {
        return nullptr;
    }
    auto taken = std::move(found->second);
    jobs_.erase(found);
    return taken;
}

std::shared_ptr<plugin_session::job> plugin_session::find(std::uint64_t id) {
    const std::scoped_lock lock{mutex_};
    const auto found = jobs_.find(id);
    return found == jobs_.end() ? nullptr : found->second;
}

void plugin_session::settle(const job& of, std::string_view body) {
    if (const auto failed = read_failure(body)) {
        if (failed->retry_ms) {
            of.answer.refuse(failed->message, std::chrono::milliseconds{*failed->retry_ms});
        } else {
            of.answer.fail(errc_from_wire(failed->error), failed->message);
        }
    } else if (body == "{}") {
        of.answer.done();
    } else {
        of.answer.done(json_text{std::string{body}}); // checked, because the process may send anything
    }
}

// The process has ended.
void plugin_session::fail(const job& of) {
    const auto how = process_.end().text();
    std::string name;
    std::string left;
    {
        const std::scoped_lock lock{mutex_};
        name = name_;
        left = left_because_;
    }
    if (left.empty()) {
        of.answer.fail(errc::failed, "the plugin '" + name + "' " + how);
    } else {
        of.answer.fail(errc::unavailable, left);
    }
}

// Called on the thread of `on_stop`.
void plugin_session::stop(std::uint64_t id) {
    const auto stopped = find(id);
    if (!stopped) {
        return;
    }
    stopped->due = std::min(stopped->due.load(), clock::now());
    say(wire_line_writer{verb::push, control_task}.parameter("cancel").parameter(id).adverb("reply", "no").body("{}"));
}

// Runs a callback of a job that has started. Called on a worker, as a part of the job. \param since when it has waited
void plugin_session::resume(const std::shared_ptr<job>& by, std::string_view line, time_point since) {
    const auto now = clock::now();
    auto due = by->due.load();
    // Nobody blames it for the time that it has waited for others, or for a worker. But if it asks for one thing after
    // another when it should have ended, these short waits are its own.
    const auto waited = now - std::max(since, due);
    if (waited > 0ns && (since <= due || waited > watch_interval(options_.grace))) {
        by->due.compare_exchange_strong(due, std::min(due + waited, now)); // fails if it is stopped meanwhile
    }
    --by->waits;
    kill_if_overdue(*by, now);
    auto* on = take_lane(by);
    if (on == nullptr) {
        return; // the job has been answered
    }
    std::string reply;
    if (exchange(*on, line, reply) == exchanged::replied) {
        give_back(on);
    }
}

// -- the control connection ----------------------------------------------------------------------------------------

void plugin_session::say(std::string_view lines) {
    const std::scoped_lock lock{out_mutex_};
    if (closed_ || ended_) {
        return;
    }
    pending_.append(lines);
    send_pending();
    if (pending_.size() > max_pending) {
        kill("it left " + std::to_string(max_pending >> 20U) + " MiB unread");
    } else if (!pending_.empty() && control_stream_ && !std::exchange(write_wait_, true)) {
        asio::post(executor_, [self = shared_from_this()] { self->wait_to_write(); });
    }
}

// With the lock.
void plugin_session::send_pending() {
    while (!pending_.empty()) {
        const auto sent = ::send(control_, pending_.data(), pending_.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        if (sent < 0 && errno == EINTR) {
            continue;
        }
        if (sent < 0) {
            if (errno != EAGAIN) {
                pending_.clear(); // the process has ended
            }
            return;
        }
        pending_.erase(0, static_cast<std::size_t>(sent));
    }
}

void plugin_session::wait_to_write() {
    if (!control_stream_) {
        return;
    }
    control_stream_->async_wait(asio::posix::stream_descriptor::wait_write,
                                [self = shared_from_this()](boost::system::error_code failed) {
                                    const std::scoped_lock lock{self->out_mutex_};
                                    self->send_pending();
                                    self->write_wait_ = !failed && !self->closed_ && !self->pending_.empty();
                                    if (self->write_wait_) {
                                        self->wait_to_write();
                                    }
                                });
}

void plugin_session::load(const load_message& what) {
    say(wire_line_writer{verb::push, control_task}.parameter("load").body(what));
}

void plugin_session::leave(std::string_view why) {
    {
        const std::scoped_lock lock{mutex_};
        left_because_ = why;
    }
    say(wire_line_writer{verb::push, control_task}.parameter("leaving").adverb("reply", "no").body("{}"));
}

void plugin_session::set_name(std::string name) {
    const std::scoped_lock lock{mutex_};
    name_ = std::move(name);
}

std::size_t plugin_session::open_jobs() const {
    const std::scoped_lock lock{mutex_};
    return jobs_.size();
}

bool plugin_session::wait_for_start(std::chrono::milliseconds limit) {
    const bool in_time = read_until(std::chrono::steady_clock::now() + limit, [this] { return answered_load_; });
    if (!in_time) {
        kill("it did not start in time");
    }
    return in_time;
}

// Reads what it says and sends what is pending, without the executor, until that is so or the process has ended. False
// if the time was up.
bool plugin_session::read_until(std::chrono::steady_clock::time_point until, const std::function<bool()>& done) {
    while (!done()) {
        short control_events = control_closed_ == time_point::max() ? POLLIN : 0;
        {
            const std::scoped_lock lock{out_mutex_};
            control_events = static_cast<short>(control_events | (pending_.empty() ? 0 : POLLOUT));
        }
        std::array<pollfd, 3> watched{
            {{.fd = process_.handle(), .events = POLLIN, .revents = 0},
             {.fd = control_events == 0 ? -1 : control_, .events = control_events, .revents = 0},
             {.fd = output_, .events = POLLIN, .revents = 0}}};
        const auto& [ended, control, output] = watched;
        const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - std::chrono::steady_clock::now());
        const auto ready = ::poll(watched.data(), watched.size(), static_cast<int>(std::max(left, 0ms).count()));
        if (ended.revents != 0) {
            read_rest();
            return true;
        }
        if (left <= 0ms) {
            return false;
        }
        if (ready <= 0) {
            continue;
        }
        if ((control.revents & POLLOUT) != 0) {
            const std::scoped_lock lock{out_mutex_};
            send_pending();
        }
        if ((control.revents & ~POLLOUT) != 0 && !read_control()) {
            control_closed_ = clock::now();
        }
        if (output.revents != 0) {
            read_output();
        }
    }
    return true;
}

// What it said last. A process that it has started may still hold the connection, so this has a limit.
void plugin_session::read_rest() {
    pollfd said{.fd = control_, .events = POLLIN, .revents = 0};
    for (int i = 0; i < 64 && ::poll(&said, 1, 0) > 0 && read_control(); ++i) {
    }
    if (output_ >= 0) {
        read_output();
    }
}

void plugin_session::run() {
    control_stream_.emplace(executor_, process_.control.release());
    output_stream_.emplace(executor_, process_.output.release());
    end_stream_.emplace(executor_, ::fcntl(process_.handle(), F_DUPFD_CLOEXEC, 0));
    read_pause_.emplace(executor_);
    watch_.emplace(executor_);
    wait_to_read();
    wait_for_output();
    wait_for_end();
    watch_jobs();
    const std::scoped_lock lock{out_mutex_};
    write_wait_ = !pending_.empty();
    if (write_wait_) {
        wait_to_write();
    }
}

void plugin_session::wait_to_read() {
    control_stream_->async_wait(asio::posix::stream_descriptor::wait_read,
                                [self = shared_from_this()](boost::system::error_code failed) {
                                    if (failed || !self->control_stream_) {
                                        return;
                                    }
                                    const auto begun = clock::now();
                                    if (self->read_control()) {
                                        self->pause_reading(clock::now() - begun);
                                    } else {
                                        self->control_closed_ = clock::now();
                                    }
                                });
}

// What it says gets half of the executor's time at most, however much that is.
void plugin_session::pause_reading(std::chrono::nanoseconds span) {
    if (span < 200us) {
        wait_to_read();
        return;
    }
    read_pause_->expires_after(span);
    read_pause_->async_wait([self = shared_from_this()](boost::system::error_code failed) {
        if (!failed && self->control_stream_) {
            self->wait_to_read();
        }
    });
}

void plugin_session::watch_jobs() {
    watch_->expires_after(watch_interval(options_.grace));
    watch_->async_wait([self = shared_from_this()](boost::system::error_code failed) {
        if (!failed && self->watch_) {
            self->kill_if_overdue();
            self->watch_jobs();
        }
    });
}

// Both those whose code runs, although they may have been answered, and those whose handlers have returned. A job that
// waits for another node, or for a worker to continue, does nothing meanwhile.
void plugin_session::kill_if_overdue() {
    const auto now = clock::now();
    if (now - control_closed_ > end_time) {
        kill("it closed a connection");
    }
    const std::scoped_lock lock{mutex_};
    for (const auto& each : lanes_) {
        if (each.used_by) {
            kill_if_overdue(*each.used_by, now);
        }
    }
    for (const auto& [id, each] : jobs_) {
        if (!each->on_lane && each->waits == 0) {
            kill_if_overdue(*each, now);
        }
    }
}

void plugin_session::kill_if_overdue(const job& of, time_point now) {
    if (now - of.due.load() > patience_of(options_.grace)) {
        kill(of.label + " did not end within " + grace_text(options_.grace) + " of its deadline or cancellation");
    }
}

void plugin_session::wait_for_output() {
    output_stream_->async_wait(asio::posix::stream_descriptor::wait_read,
                               [self = shared_from_this()](boost::system::error_code failed) {
                                   if (failed || !self->output_stream_) {
                                       return;
                                   }
                                   self->read_output();
                                   if (self->output_ >= 0) {
                                       self->wait_for_output();
                                   }
                               });
}

void plugin_session::wait_for_end() {
    end_stream_->async_wait(asio::posix::stream_descriptor::wait_read,
                            [self = shared_from_this()](boost::system::error_code failed) {
                                if (!failed) {
                                    self->finish();
                                }
                            });
}

// Reads once, so that a process that says much delays nothing else. False at the end of the stream.
bool plugin_session::read_control() {
    std::string part(max_control_read, '\0');
    const auto size = ::recv(control_, part.data(), part.size(), MSG_DONTWAIT);
    if (size < 0) {
        return errno == EAGAIN || errno == EINTR;
    }
    if (size == 0) {
        return false;
    }
    input_.append({part.data(), static_cast<std::size_t>(size)});
    while (const auto line = input_.next()) {
        on_line(*line);
    }
    if (input_.rest().size() > options_.max_line) {
        kill("it sent a line of more than " + std::to_string(options_.max_line) + " bytes");
        return false;
    }
    return true;
}

void plugin_session::read_output() {
    std::array<char, 4096> part; // NOLINT(*-member-init): it is written before it is read
    const auto size = ::read(output_, part.data(), part.size());
    if (size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR)) {
        output_ = -1;
    }
    output_text_.append({part.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0))});
    while (const auto line = output_text_.next()) {
        events_.output(*line);
    }
    if (const auto rest = output_text_.rest(); rest.size() > max_output_line || (output_ < 0 && !rest.empty())) {
        events_.output(rest);
        output_text_.clear();
    }
}

void plugin_session::on_line(std::string_view line) {
    const auto read = read_wire_line(line);
    try {
        if (!read) {
            throw error(errc::bad_request, "it is not a line");
        }
        read->is_reply ? on_reply(*read) : on_request(*read);
    } catch (const std::exception& e) {
        kill("what it said is invalid: " + std::string{e.what()});
    }
}

// A report of progress, or a reply that was given later.
void plugin_session::on_reply(const wire_line& line) {
    const auto progress = line.adverb("progress");
    if (progress.empty()) {
        if (const auto done = take(line.id)) {
            settle(*done, line.body);
        }
        return;
    }
    const auto of = find(line.id);
    double fraction = 0;
    if (!of || of->progress_unwanted || !json_reader{progress}.read(fraction)) {
        return;
    }
    if (!of->answer.progress(fraction, json_text{std::string{line.body}}) && !of->answer.stopped()) {
        of->progress_unwanted = true;
        say(wire_line_writer{verb::push, control_task}
                .parameter("progress_unwanted")
                .parameter(line.id)
                .adverb("reply", "no")
                .body("{}"));
    }
}

namespace {

std::string_view wire_name_of(boost::system::error_code code) noexcept {
    const bool ours = code.category() == error_category();
    return wire_name(code == errc::stopped ? errc::unavailable : ours ? static_cast<errc>(code.value()) : errc::failed);
}

// What answers a `next`.
std::string event_line(std::uint64_t ticket, boost::system::error_code code, const job_event& what) {
    wire_line_writer line{verb::push, control_task};
    line.parameter("answered").parameter(ticket);
    if (code) {
        line.adverb("code", wire_name_of(code));
    } else {
        line.adverb("event", event_names[static_cast<std::size_t>(what.kind)]);
        line.adverb("publisher", what.publisher);
        line.adverb("seq", static_cast<std::int64_t>(what.seq))
            .adverb("epoch", std::int64_t{what.epoch})
            .adverb("missed", static_cast<std::int64_t>(what.missed));
        line.adverb("waited", std::int64_t{what.waited.count()});
    }
    return line.adverb("message", what.text).body(what.json);
}

template <class T>
T body_of(const wire_line& line) {
    T read{};
    std::string why;
    if (!from_json(line.body, read, &why)) {
        throw error(errc::bad_request, why);
    }
    return read;
}

} // namespace

void plugin_session::on_request(const wire_line& line) {
    const auto what = line.task == control_task && !line.parameters.empty() ? line.parameters.front() : std::string{};
    if (what == "publish" && line.parameters.size() == 2) {
        events_.publish(line.parameters[1], line.body);
    } else if (what == "ask") {
        ask(line);
    } else if (what == "bind") {
        bind(line);
    } else if (what == "next") {
        next(line);
    } else if (what == "unbind") {
        unbind(line);
    } else if (what == "log") {
        const auto entry = body_of<log_message>(line);
        const auto level = static_cast<log_level>(std::min<std::uint32_t>(entry.level, 3));
        const auto of = find(line.number_at(1));
        events_.log(level, std::string_view{entry.text}.substr(0, max_log_text), of ? &of->answer : nullptr);
    } else if (what == "started" && !answered_load_) {
        answered_load_ = true;
        events_.started(body_of<started_message>(line));
    } else if (what == "refused" && !answered_load_) {
        answered_load_ = true;
        events_.refused(body_of<refused_message>(line));
    } else {
        throw error(errc::bad_request, "it is no request to the daemon");
    }
}

// A request to another node, on behalf of a job. Its answer, and reports of its progress, continue the job on a worker.
void plugin_session::ask(const wire_line& line) {
    const auto ticket = line.number_at(2);
    const auto wanted = body_of<ask_message>(line);
    const auto since = clock::now();
    const auto answered = [weak = weak_from_this(), ticket, since](const std::shared_ptr<job>& by,
                                                                   boost::system::error_code code,
                                                                   std::string_view json, std::string_view message) {
        const auto self = weak.lock();
        if (!self) {
            return;
        }
        wire_line_writer reply{verb::push, control_task};
        reply.parameter("answered").parameter(ticket);
        if (code) {
            reply.adverb("code", wire_name_of(code)).adverb("message", message);
        }
        const auto text = reply.body(json.empty() ? std::string_view{"{}"} : json);
        by ? self->resume(by, text, since) : self->say(text);
    };
    const auto by = find(line.number_at(1));
    if (!by) {
        answered(nullptr, errc::cancelled, "{}", "the requester of the job no longer waits");
        return;
    }
    if (!begin_wait(*by)) {
        answered(nullptr, errc::busy, "{}", "too many requests at once");
        return;
    }
    call_options options;
    options.urgent(wanted.urgent).at(wanted.at).hops(wanted.hops);
    options.deadline(std::chrono::milliseconds{wanted.deadline_ms});
    if (wanted.progress) {
        options.on_progress([weak = weak_from_this(), by, ticket, since](double fraction, std::string_view json) {
            if (const auto self = weak.lock()) {
                self->resume(by,
                             wire_line_writer{verb::push, control_task}
                                 .parameter("reported")
                                 .parameter(ticket)
                                 .adverb("progress", to_json(fraction))
                                 .body(json),
                             since);
                ++by->waits;
            }
        });
    }
    by->answer.delegate(wanted.command, options,
                        [weak = weak_from_this(), by, answered](boost::system::error_code code, std::string_view json,
                                                                std::string_view message) {
                            answered(by, code, json, message);
                            if (const auto self = weak.lock()) {
                                --self->asks_;
                            }
                        });
}

// Whether the job may wait for one thing more.
bool plugin_session::begin_wait(job& by) {
    if (asks_.fetch_add(1) >= max_asks) {
        --asks_;
        return false;
    }
    ++by.waits;
    return true;
}

// Why it cannot be bound, `next` tells.
void plugin_session::bind(const wire_line& line) {
    const auto wanted = body_of<bind_message>(line);
    const auto by = find(line.number_at(1));
    if (!by || by->feeds.size() >= max_feeds) {
        return;
    }
    bind_options options;
    options.at(wanted.at).keep(wanted.keep).every(std::chrono::milliseconds{wanted.every_ms});
    options.deadline(std::chrono::milliseconds{wanted.deadline_ms}).hops(wanted.hops).mark(wanted.mark);
    by->feeds.insert_or_assign(line.number_at(2), by->answer.bind(wanted.noun, options));
}

// An event continues the job on a worker, as an answer does. So the process has one of each feed at most.
void plugin_session::next(const wire_line& line) {
    const auto ticket = line.number_at(3);
    const auto by = find(line.number_at(1));
    job_feed feed;
    if (by) {
        const auto found = by->feeds.find(line.number_at(2));
        feed = found == by->feeds.end() ? job_feed{} : found->second;
    }
    if (!feed.is_open()) {
        say(event_line(ticket, errc::cancelled, {.text = "the feed is closed"}));
        return;
    }
    if (!begin_wait(*by)) {
        say(event_line(ticket, errc::busy, {.text = "too many requests at once"}));
        return;
    }
    feed.next([weak = weak_from_this(), by, ticket, since = clock::now()](boost::system::error_code code,
                                                                          const job_event& what) {
        if (const auto self = weak.lock()) {
            self->resume(by, event_line(ticket, code, what), since);
            --self->asks_;
        }
    });
}

void plugin_session::unbind(const wire_line& line) {
    if (const auto by = find(line.number_at(1))) {
        by->feeds.erase(line.number_at(2));
    }
}

// -- the end -------------------------------------------------------------------------------------------------------

void plugin_session::finish() {
    if (std::exchange(finished_, true)) {
        return;
    }
    ended_ = true;
    const auto how = process_.end();
    read_rest();
    for (const auto& each : lanes_) {
        ::shutdown(each.socket, SHUT_RDWR); // another process may still hold the other end
    }
    std::vector<std::shared_ptr<job>> left;
    {
        const std::scoped_lock lock{mutex_};
        for (auto& [id, each] : jobs_) {
            if (!each->on_lane) {
                left.push_back(each);
            }
        }
        boost::unordered::erase_if(jobs_, [](const auto& each) { return !each.second->on_lane; });
        lane_freed_.notify_all();
    }
    for (const auto& each : left) {
        fail(*each);
    }
    {
        const std::scoped_lock lock{out_mutex_};
        closed_ = true;
        control_stream_.reset();
        executor_ = {};
    }
    output_stream_.reset();
    end_stream_.reset();
    read_pause_.reset();
    watch_.reset();
    events_.ended(how);
}

bool plugin_session::close(std::chrono::steady_clock::time_point until) {
    if (finished_) {
        return false;
    }
    const bool late = !read_until(until, [] { return false; });
    if (late) {
        kill("it did not stop in time");
    }
    finish();
    return late;
}

} // namespace cles::runtime
