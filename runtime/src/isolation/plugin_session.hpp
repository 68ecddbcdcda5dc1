// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/job_feed.hpp>
#include <cles/limits.hpp>
#include <cles/log.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>

#include "isolation/line_buffer.hpp"
#include "isolation/plugin_messages.hpp"
#include "isolation/plugin_process.hpp"
#include "isolation/wire_line.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/unordered/unordered_flat_map.hpp>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::runtime {

struct session_options {
    std::string plugin;               ///< its file
    std::size_t lanes = 1;            ///< how many jobs may run at once
    std::chrono::nanoseconds grace{}; ///< for jobs to end after their deadline
    std::size_t max_line = 4U << 20U; ///< bytes that the process may send in one line
};

/// How long a job may take to end after its deadline. Somewhat shorter than the grace, so that the pool does not take
/// its worker for stuck.
std::chrono::nanoseconds patience_of(std::chrono::nanoseconds grace);

/// What happens in the process of a plugin. All are called on the executor.
struct session_events {
    std::function<void(const started_message&)> started;
    std::function<void(const refused_message&)> refused;
    std::function<void(log_level, std::string_view, const responder* job)> log; ///< null: it is about no job
    std::function<void(std::string_view text)> output;                          ///< a line of its stdout or stderr
    std::function<void(std::string_view noun, std::string_view json)> publish;
    /// The last one: it has ended, and all its jobs have been answered.
    std::function<void(const process_end& how)> ended;
};

/// One run of the process of an isolated plugin, from its start to its end: the daemon's side of the jobs in it.
///
/// A worker hands a job over on a lane, a connection with a thread at its other end, and waits there until the handler
/// has returned. So the pool counts and limits jobs as if they ran here, and no thread but these two is woken. All else
/// goes over the control connection, in order: replies that are given later, reports of progress, cancellations.
class plugin_session : public std::enable_shared_from_this<plugin_session> {
  public:
    /// \param name of the plugin, for messages \throws std::system_error if the process cannot be started
    plugin_session(boost::asio::any_io_executor executor, std::string name, session_options options,
                   session_events events);
    plugin_session(const plugin_session&) = delete;
    plugin_session& operator=(const plugin_session&) = delete;
    ~plugin_session() = default;

    // -- on the executor -------------------------------------------------------------------------------------------
    void load(const load_message& what);
    /// Waits for `started`, `refused` or the end, without the executor. Only before `run`. False if the time was up,
    /// and the process is killed then.
    bool wait_for_start(std::chrono::milliseconds limit);
    /// From now on, reads what it says, and watches its jobs.
    void run();
    void set_name(std::string name);
    /// Asks the process to stop the plugin and to end. Its jobs are answered `unavailable`.
    void leave(std::string_view why);
    /// Waits for the end without the executor, and kills the process at that time. Returns whether it had to be killed.
    bool close(std::chrono::steady_clock::time_point until);
    [[nodiscard]] std::size_t open_jobs() const;
    [[nodiscard]] pid_t process() const noexcept { return process_.id(); }

    // -- on any thread ---------------------------------------------------------------------------------------------
    /// Whether it can take jobs.
    [[nodiscard]] bool usable() const noexcept { return !ended_.load(std::memory_order_acquire); }
    /// Runs a job; returns when its handler has returned. False if the job has not been started, because the process
    /// has ended.
    bool serve(const request& what, const responder& answer);
    /// Ends the process because of what it does.
    void kill(std::string_view why) { process_.kill(why); }

  private:
    // A job whose requester waits.
    struct job {
        job(responder by, std::string what, time_point until)
            : answer(std::move(by)), label(std::move(what)), due(until) {}

        responder answer;
        std::string label;               // PULL 'speed'
        std::atomic<time_point> due;     // by when it should have ended
        std::atomic<bool> on_lane{true}; // its worker answers it if the process ends
        std::atomic<int> waits{0};       // for the answers to requests that it has sent, and for events
        bool progress_unwanted = false;  // used on the executor, as is the next
        boost::unordered_flat_map<std::uint64_t, job_feed> feeds{}; // by the numbers that the process has given them
    };
    struct lane {
        int socket = -1;
        line_buffer input{};
        std::shared_ptr<const job> used_by{}; // which may have been answered
    };
    enum class exchanged : std::uint8_t { replied, unread, lost };

    lane* take_lane(const std::shared_ptr<const job>& by);
    void give_back(lane* used);
    exchanged exchange(lane& on, std::string_view line, std::string& reply);
    exchanged lose(int code);
    std::shared_ptr<job> take(std::uint64_t id);
    [[nodiscard]] std::shared_ptr<job> find(std::uint64_t id);
    void settle(const job& of, std::string_view body);
    void fail(const job& of);
    void stop(std::uint64_t id);
    void resume(const std::shared_ptr<job>& by, std::string_view line, time_point since);

    // Says something on the control connection.
    void say(std::string_view lines);
    void send_pending();
    void wait_to_write();
    void wait_to_read();
    void pause_reading(std::chrono::nanoseconds span);
    void wait_for_output();
    void wait_for_end();
    void watch_jobs();
    void kill_if_overdue();
    void kill_if_overdue(const job& of, time_point now);
    bool read_until(std::chrono::steady_clock::time_point until, const std::function<bool()>& done);
    void read_rest();
    bool read_control();
    void read_output();
    void on_line(std::string_view line);
    void on_reply(const wire_line& line);
    void on_request(const wire_line& line);
    void ask(const wire_line& line);
    void bind(const wire_line& line);
    void next(const wire_line& line);
    void unbind(const wire_line& line);
    bool begin_wait(job& by);
    void finish();

    boost::asio::any_io_executor executor_;
    const session_options options_;
    const session_events events_;
    plugin_process process_;
    int control_; // the descriptor
    int output_;
    // Nothing of the executor is held after the end, because its context may be destroyed then.
    std::optional<boost::asio::posix::stream_descriptor> control_stream_;
    std::optional<boost::asio::posix::stream_descriptor> output_stream_;
    std::optional<boost::asio::posix::stream_descriptor> end_stream_;
    std::optional<boost::asio::steady_timer> read_pause_;
    std::optional<boost::asio::steady_timer> watch_;
    line_buffer input_;
    line_buffer output_text_;
    time_point control_closed_ = time_point::max(); // when the process closed the connection
    bool answered_load_ = false;                    // it has said `started` or `refused`
    bool finished_ = false;

    std::atomic<bool> ended_{false};
    std::atomic<std::uint64_t> last_id_{0};
    std::atomic<std::size_t> asks_{0};

    mutable std::mutex mutex_; // of all that follows
    std::string name_;
    std::string left_because_; // not empty: the daemon ends it
    boost::unordered_flat_map<std::uint64_t, std::shared_ptr<job>> jobs_;
    std::vector<lane> lanes_;
    std::vector<lane*> free_lanes_;
    std::condition_variable lane_freed_;

    std::mutex out_mutex_; // of the rest
    std::string pending_;
    bool write_wait_ = false;
    bool closed_ = false;
};

} // namespace cles::runtime
