// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>
#include <cles/plugin_abi.h>
#include <cles/publisher.hpp>
#include <cles/registrar.hpp>

#include "jobs/stop_notifier.hpp"
#include "plugins/plugin_feeds.hpp"
#include "plugins/plugin_jobs.hpp"

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::runtime {

/// The log of plugins. Called from any thread; it must neither throw nor block.
using plugin_log = std::function<void(log_level, std::string_view plugin, std::string_view text)>;

/// A plugin whose library has been loaded: the host's side of its functions and tasks.
///
/// It exists until the process ends, as does the library: a job that never ends may run the library's code, or call its
/// host, at any time.
class loaded_plugin {
  public:
    /// \param description has been checked
    loaded_plugin(const cles_plugin& description, std::string node, plugin_jobs& jobs, stop_notifier& notifier,
                  plugin_log log);
    loaded_plugin(const loaded_plugin&) = delete;
    loaded_plugin& operator=(const loaded_plugin&) = delete;
    ~loaded_plugin() = default;

    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] const std::string& version() const noexcept { return version_; }

    /// Which other plugin provides a task; called for each task that this one adds.
    using owner_lookup = std::function<std::optional<std::string>(cles::verb, std::string_view task)>;
    struct refusal {
        std::string why;
        std::string key = "path"; ///< that is to blame, as in `plugin_error`
    };
    /// Lets the plugin check its settings, without starting it.
    std::optional<refusal> check(const std::string& config);
    /// Starts the plugin, which adds its tasks. Returns why it cannot be used, if so.
    std::optional<refusal> start(const std::string& config, publisher updates, const owner_lookup& owner_of);
    /// The tasks that it added, to be registered. Their requests are refused after `close`.
    [[nodiscard]] std::vector<registration> take_tasks() noexcept { return std::move(tasks_); }
    /// Starts no further jobs.
    void close() noexcept { closed_ = true; }
    /// Stops the plugin. May take long, or never return.
    void stop() noexcept;
    /// Stops using the log, which may be destroyed then.
    void disable_log() noexcept;
    /// Whether `stop` has returned, or is not needed.
    [[nodiscard]] bool has_stopped() const noexcept { return stopped_; }

  private:
    using task_handler = decltype(cles_task::start);

    // `functions` is passed to the plugin. It is the first member, so that a function of the host finds the other.
    struct host_functions {
        cles_host functions;
        loaded_plugin* plugin;
    };
    struct host_api; // the implementation of `cles_host`

    std::int32_t add_task(const cles_task& added);
    template <class F>
    std::optional<refusal> run_guarded(const char* what, F&& call);
    void note_refusal(refusal what);
    void run(task_handler handler, void* user, const request& what, const responder& answer);
    void call_handler(task_handler handler, void* user, const request& what, plugin_jobs::id job) const;
    void finish(plugin_jobs::id job, std::function<void(const responder&)> answer);
    void delegate(plugin_jobs::id job, std::string_view command, const cles_ask& ask);
    plugin_feeds::id bind(plugin_jobs::id job, std::string_view noun, const cles_bind& how);
    void next(plugin_feeds::id feed, const cles_next& wanted);
    void call_after(plugin_jobs::id job, std::function<void()> callback);
    void call_on_other_thread(std::function<void()> callback);
    void log(log_level level, std::string_view text) const;

    const cles_plugin description_;
    const std::string name_;
    const std::string version_;
    const std::string node_;
    plugin_jobs& jobs_;
    plugin_feeds feeds_;
    stop_notifier& notifier_;
    mutable std::mutex log_mutex_;
    plugin_log log_;
    host_functions host_;
    std::optional<publisher> updates_;
    std::vector<registration> tasks_;
    const owner_lookup* owner_of_ = nullptr; ///< while it starts
    bool may_refuse_ = false;                ///< while it starts or checks its settings
    refusal refusal_{};                      ///< why a task was refused, or the plugin's own message
    std::atomic<bool> closed_{false};
    std::atomic<bool> stopped_{true};
    std::atomic<bool> unknown_job_reported_{false};
};

} // namespace cles::runtime
