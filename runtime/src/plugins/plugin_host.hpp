// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

#include "jobs/stop_notifier.hpp"
#include "plugins/loaded_plugin.hpp"
#include "plugins/plugin_file.hpp"
#include "plugins/plugin_library.hpp"

#include <boost/describe/class.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace cles::runtime {

struct plugin_host_options {
    std::string node;     ///< this node's name
    plugin_rules rules{}; ///< which files may be loaded; plugins named without a folder are searched for in its folders
    plugin_log log{};     ///< called until `plugin_host::stop` returns
    /// How long a library may take to load in a child process that tries it first, so that a crash or a hang there does
    /// no harm. 0: it is not tried.
    std::chrono::milliseconds trial{10'000};
};

struct plugin_info {
    std::string path; ///< as written in the configuration
    std::string name;
    std::string version;
    std::vector<std::string> tasks; ///< "PULL utc"
};

/// What `plugin_host::stop` could not stop. If there is anything, the process has to end with `std::quick_exit` or
/// `std::_Exit`.
struct plugin_stop_report {
    std::vector<std::string> late{}; ///< the names of the plugins that did not stop in time
    std::size_t callbacks = 0;       ///< `on_stop` callbacks that did not return
};

struct plugin_figures {
    std::uint64_t loaded = 0;
    std::uint64_t jobs = 0;           ///< without an answer
    std::uint64_t answered_twice = 0; ///< answers to jobs that did not exist (any more)
};
BOOST_DESCRIBE_STRUCT(plugin_figures, (), (loaded, jobs, answered_twice))

/// Loads plugins (docs/plugins.md) and registers their tasks.
///
/// All functions have to be called on the service's executor, and the host has to be destroyed before its service.
/// Libraries stay loaded until the process ends, and what was passed to them stays valid: a job that does not end, or a
/// thread of the library, may run the library's code or call the host as long as the process exists.
class plugin_host {
  public:
    explicit plugin_host(plugin_host_options options);
    plugin_host(const plugin_host&) = delete;
    plugin_host& operator=(const plugin_host&) = delete;
    /// Stops the plugins if they have not been stopped, within two seconds.
    ~plugin_host();

    /// Loads a plugin, passes it its settings (a JSON object), and registers its tasks. \param sha256 of its file, in
    /// small hexadecimal digits; empty: any
    /// \throws plugin_error
    void load(const std::string& path, const std::string& config, registrar& into, const std::string& sha256 = {});

    [[nodiscard]] const std::vector<plugin_info>& plugins() const noexcept { return plugins_; }
    [[nodiscard]] plugin_figures figures() const;

    /// Starts no further jobs, answers open ones `unavailable`, and stops the plugins, in reverse order, when their
    /// `on_stop` callbacks have returned or half of the limit has passed.
    plugin_stop_report stop(std::chrono::milliseconds limit);
    /// A limit that suffices for callbacks and plugins that do not block.
    static constexpr std::chrono::milliseconds min_stop_time = 2 * stop_notifier::min_close_time;

  private:
    struct state;

    plugin_host_options options_;
    std::vector<plugin_info> plugins_;
    std::shared_ptr<state> state_;
    bool stopped_ = false;
};

} // namespace cles::runtime
