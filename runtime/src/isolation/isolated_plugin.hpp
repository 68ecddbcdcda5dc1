// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "isolation/log_rate.hpp"
#include "isolation/plugin_session.hpp"
#include "isolation/restart_policy.hpp"
#include "jobs/job_pool.hpp"
#include "plugins/loaded_plugin.hpp"

#include <boost/asio/steady_timer.hpp>
#include <boost/describe/class.hpp>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::runtime {

/// The state of an isolated plugin, for metrics.
struct isolated_plugin_figures {
    std::string name;
    std::string state;         ///< running, starting, withdrawn
    std::uint64_t process = 0; ///< its id; 0: none
    std::uint64_t ended = 0;   ///< how often its process has ended unexpectedly
    std::uint64_t jobs = 0;    ///< without an answer
};
BOOST_DESCRIBE_STRUCT(isolated_plugin_figures, (), (name, state, process, ended, jobs))

/// A plugin that runs in a process of its own (docs/plugins.md, "Isolation"): it is started again when it ends, and its
/// tasks are withdrawn when it ends too often.
class isolated_plugin : public std::enable_shared_from_this<isolated_plugin> {
  public:
    /// Its tasks are those of the service, and their jobs run on the pool. \param loading what the process is told
    isolated_plugin(service& host, job_pool& pool, plugin_log log, load_message loading, session_options session);
    isolated_plugin(const isolated_plugin&) = delete;
    isolated_plugin& operator=(const isolated_plugin&) = delete;
    ~isolated_plugin() = default;

    // All on the executor.
    /// Starts it and registers its tasks. Blocks until it has started. \throws plugin_error
    void start();
    /// Starts it again if its tasks were withdrawn, and returns whether they were. \param changed what its process is
    /// told from now on; nothing: the same as before
    bool retry(std::optional<load_message> changed);
    /// Asks the plugin to stop, without waiting.
    void begin_stop();
    /// Waits for its end, and kills it at that time. Returns whether it had to be killed.
    bool finish_stop(std::chrono::steady_clock::time_point until);

    [[nodiscard]] isolated_plugin_figures figures() const;

  private:
    void run(const request& what, const responder& answer);
    std::shared_ptr<plugin_session> session_for(const responder& answer);
    void launch();
    session_events events_of(std::uint64_t run);
    void on_started(const started_message& what);
    void on_ended(const process_end& how);
    [[nodiscard]] std::string describe(const process_end& how) const;
    void restart_after(std::chrono::milliseconds delay, const std::string& why);
    void relaunch();
    void offer(const std::vector<offered_task>& tasks);
    void remove(const offered_task& task);
    void withdraw();
    void publish(std::string_view noun, std::string_view json);
    void log(log_level level, std::string_view text);
    void log_output(log_level level, std::string_view text, const responder* job = nullptr);

    service& host_;
    job_pool& pool_;
    const plugin_log log_;
    load_message loading_;
    const session_options session_options_;
    std::string name_; // the path until it is known
    restart_policy policy_;
    log_rate log_rate_;
    std::vector<offered_task> offered_;
    std::shared_ptr<plugin_session> starting_; // until it has started
    // When its start takes too long, or has to be tried again. Not held after the end, as by a session.
    std::optional<boost::asio::steady_timer> start_timer_;
    std::uint64_t run_ = 0;   // which one is the latest
    std::uint64_t ended_ = 0; // how often its process has ended unexpectedly
    std::optional<refused_message> refused_;
    std::string start_failure_;
    std::string last_output_;
    bool first_start_ = true;
    bool stopping_ = false;

    mutable std::mutex mutex_; // of all that follows, which workers use
    std::shared_ptr<plugin_session> current_;
    std::optional<time_point> missing_since_; // there is no process that takes jobs
    std::string why_unavailable_;             // withdrawn, or the daemon stops; else empty
    std::condition_variable changed_;
};

} // namespace cles::runtime
