// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

#include "jobs/stop_notifier.hpp"
#include "plugins/loaded_plugin.hpp"
#include "plugins/plugin_search.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace cles::runtime {

struct plugin_host_options {
    std::string node;                           ///< this node's name
    std::vector<std::filesystem::path> folders; ///< where plugins are looked for that are named without one
    plugin_log log{};                           ///< called until `plugin_host::stop` returns
    /// How long a library may take to be loaded, in a child process that tries it first, so that one which crashes or
    /// hangs there harms nobody. 0: it is not tried.
    std::chrono::milliseconds trial{10'000};
};

struct plugin_info {
    std::string path; ///< as the configuration names it
    std::string name;
    std::string version;
    std::vector<std::string> tasks; ///< "PULL utc"
};

/// What `plugin_host::stop` leaves behind. Where it is anything, the process can end by `std::quick_exit` or
/// `std::_Exit` alone.
struct plugin_stop_report {
    std::vector<std::string> late{}; ///< the names of the plugins that have not stopped in time
    std::size_t callbacks = 0;       ///< `on_stop` callbacks that have not returned
};

struct plugin_figures {
    std::size_t jobs = 0;             ///< that are not answered
    std::uint64_t answered_twice = 0; ///< answers to jobs that were not there (any more)
};

/// Loads plugins (docs/plugins.md) and registers their tasks: the only place that knows Boost.DLL.
///
/// All functions are to be called on the service's executor, and the host ends before its service. What it loads stays
/// loaded until the process ends, and so does what the plugins were given: a job that does not end may run the
/// library's code, or call the host, for as long as the process lives, and so may threads of the library's own.
class plugin_host {
  public:
    explicit plugin_host(plugin_host_options options);
    plugin_host(const plugin_host&) = delete;
    plugin_host& operator=(const plugin_host&) = delete;
    /// Stops what has not been stopped, and waits two seconds for it.
    ~plugin_host();

    /// Loads a plugin, hands it its configuration (a JSON object), and registers its tasks.
    /// \throws plugin_error
    void load(const std::string& path, const std::string& config, registrar& into);

    [[nodiscard]] const std::vector<plugin_info>& plugins() const noexcept { return plugins_; }
    [[nodiscard]] plugin_figures figures() const;

    /// Starts no further job, answers those that are left `unavailable`, and lets the plugins stop, the last one first,
    /// when their `on_stop` callbacks have returned or half of the limit is over.
    plugin_stop_report stop(std::chrono::milliseconds limit);
    /// A limit in which callbacks that do not block have returned, and plugins that do not block have stopped.
    static constexpr std::chrono::milliseconds least_stop = 2 * stop_notifier::last_moment;

  private:
    struct state;

    plugin_host_options options_;
    std::vector<plugin_info> plugins_;
    std::shared_ptr<state> state_;
    bool stopped_ = false;
};

} // namespace cles::runtime
