// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>
#include <cles/plugin_abi.h>
#include <cles/publisher.hpp>
#include <cles/registrar.hpp>

#include "jobs/stop_notifier.hpp"
#include "plugins/plugin_jobs.hpp"

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::runtime {

/// Where plugins tell what happens. Called from any thread; it must neither throw nor block.
using plugin_log = std::function<void(log_level, std::string_view plugin, std::string_view text)>;

/// A plugin that has been described and is to be started, or has been: the host's side of its functions and tasks.
///
/// It stays until the process ends, as the library does: a job that never ends may call its host, and may be in the
/// library's code, at any time.
class loaded_plugin {
  public:
    /// The description has been checked.
    loaded_plugin(const cles_plugin& description, std::string node, plugin_jobs& jobs, stop_notifier& notifier,
                  plugin_log log);
    loaded_plugin(const loaded_plugin&) = delete;
    loaded_plugin& operator=(const loaded_plugin&) = delete;
    ~loaded_plugin() = default;

    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] const std::string& version() const noexcept { return version_; }

    /// Whether another plugin has this task; to be asked for each that this one adds.
    using taken = std::function<std::optional<std::string>(cles::verb, std::string_view task)>;
    struct refusal {
        std::string why;
        std::optional<std::string> setting; ///< the key of the one that is to blame; empty: all of them together
    };
    /// Has it look whether it could do with these settings, which it does by its own code, and no more.
    std::optional<refusal> check(const std::string& config);
    /// Has it add its tasks. Nothing, or why it cannot be used.
    std::optional<refusal> start(const std::string& config, publisher updates, const taken& by_other);
    /// What it added, to be registered. Requests for them are refused from `close` on.
    [[nodiscard]] std::vector<registration> tasks() const;
    /// No further job is started.
    void close() noexcept { closed_ = true; }
    /// Lets the plugin stop. It may take its time, or never return.
    void stop() noexcept;
    /// Tells the log nothing any more, which may go now.
    void silence() noexcept;
    /// Whether `stop` has returned, or was not needed.
    [[nodiscard]] bool has_stopped() const noexcept { return stopped_; }

  private:
    struct task {
        loaded_plugin* of;
        registration what; // without handlers
        void (*start)(void*, cles_job, const cles_request*);
        void* user;
    };

    // What it is given; the first member, so that a function of the host finds the rest.
    struct host_functions {
        cles_host face;
        loaded_plugin* of;
    };
    struct from_plugin; // the functions themselves

    std::int32_t add_task(const cles_task& added);
    template <class F>
    std::optional<refusal> guarded(const char* what, F&& call);
    [[noreturn]] void refuse_job() const;
    void run(const task& t, const request& what, const responder& answer);
    void call_start(const task& t, const request& what, plugin_jobs::id job) const;
    void delegate(plugin_jobs::id job, std::string_view command, const cles_ask& ask);
    void call_elsewhere(std::function<void()> callback);
    void say(log_level level, std::string_view text) const;
    void note_unknown();

    const cles_plugin description_;
    const std::string name_;
    const std::string version_;
    const std::string node_;
    plugin_jobs& jobs_;
    stop_notifier& notifier_;
    mutable std::mutex log_mutex_;
    plugin_log log_;
    host_functions host_;
    std::optional<publisher> updates_;
    std::vector<std::unique_ptr<task>> tasks_;
    const taken* taken_ = nullptr; ///< while it starts
    bool may_refuse_ = false;      ///< while it starts or checks its settings
    std::string refusal_;          ///< why a task was refused, or the plugin's own words
    std::optional<std::string> refused_setting_;
    std::atomic<bool> closed_{false};
    std::atomic<bool> stopped_{true};
    std::atomic<bool> noted_unknown_{false};
};

} // namespace cles::runtime
