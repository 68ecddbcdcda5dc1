// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/job_feed.hpp>
#include <cles/log.hpp>
#include <cles/publisher.hpp>
#include <cles/registrar.hpp>
#include <cles/responder.hpp>

#include "isolation/wire_line.hpp"
#include "jobs/stop_callback.hpp"
#include "jobs/stop_notifier.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::runtime {

/// The connection to the daemon that is not a lane. Lines of several threads do not mix.
class control_connection {
  public:
    explicit control_connection(int socket) noexcept : socket_(socket) {}
    control_connection(const control_connection&) = delete;
    control_connection& operator=(const control_connection&) = delete;

    /// Waits until the daemon has read enough to take it.
    void say(std::string_view lines);
    /// Has the daemon log it. \param job that it is about; 0: none
    void log(log_level level, std::string_view text, std::uint64_t job = 0);
    /// To keep what follows in order.
    [[nodiscard]] static std::uint64_t lines_sent_by_this_thread() noexcept;

  private:
    int socket_;
    std::mutex mutex_;
};

/// The jobs in the process of an isolated plugin: its tasks, and what the daemon tells about its jobs.
///
/// All functions may be called from any thread once the tasks have been added.
class process_jobs {
  public:
    explicit process_jobs(control_connection& daemon) noexcept : daemon_(daemon) {}
    process_jobs(const process_jobs&) = delete;
    process_jobs& operator=(const process_jobs&) = delete;

    void add(registration task);

    /// Runs the handler of a request from a lane. Returns the line that ends it there: its reply, or that it replies
    /// later.
    std::string serve(const wire_line& line, std::string_view node);
    /// The job whose handler runs on this thread, if it is traced; else 0.
    [[nodiscard]] static std::uint64_t traced_here() noexcept;
    /// Runs a callback of a job: a request that it has sent is answered or reports progress, or there is an event of a
    /// feed. If other code of the job runs meanwhile, the callback runs after that, on its thread. \param text the line
    void resume(const wire_line& line, std::string_view text);

    // From the control connection:
    void cancel(std::uint64_t id);
    void progress_unwanted(std::uint64_t id);
    /// The same as `resume`, on another thread. \param line has been read without an error
    void resume_on_notifier(std::string_view line);

  private:
    class call;
    class feed;
    struct asked {
        std::uint64_t job;
        answer_callback answered;
        std::function<void(double, std::string_view)> progress{};
        event_callback event{}; ///< instead of `answered`
    };

    std::uint64_t add_request(asked what);
    void deliver(const asked& request, const wire_line& line);
    static void run_callback(const asked& request, const wire_line& line);
    void end_turn(std::uint64_t job);

    control_connection& daemon_;
    std::map<std::pair<verb, std::string>, async_handler, std::less<>> tasks_;
    stop_notifier notifier_;
    std::mutex mutex_; // of all that follows
    boost::unordered_flat_map<std::uint64_t, call*> calls_;
    // The jobs whose code runs, and what they get afterwards.
    boost::unordered_flat_map<std::uint64_t, std::vector<std::function<void()>>> turns_;
    boost::unordered_flat_map<std::uint64_t, std::shared_ptr<asked>> requests_;
    std::uint64_t last_ticket_ = 0;
    std::uint64_t last_feed_ = 0;
    // A cancellation may overtake its request, which comes by another connection.
    std::deque<std::uint64_t> cancelled_early_;
};

} // namespace cles::runtime
