// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"
#include "isolation/isolation_limits.hpp"
#include "plugins/plugin_error.hpp"
#include "plugins/plugin_file.hpp"

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>

namespace cles::runtime {

struct trial_confinement {
    isolation_limits limits;
    std::size_t threads; ///< that the daemon starts in the process of the plugin
};

/// Loads a plugin in a child process, calls its entry point, and lets it check its settings. Its tasks are not
/// registered.
///
/// The code that a library runs then cannot be guarded against in the same process: an exception from the constructor
/// of a global object ends the process, as does a crash, and a function that never returns blocks it. The last output
/// of the child is part of the exception. A trial takes a few milliseconds. It has to be made before the process starts
/// threads: the child is a copy of this thread only, in which a lock of another thread is never released.
///
/// \param path as written in the configuration \param file its file \param config its settings, a JSON object
/// \param confined to this, as it will be when it runs
/// \throws plugin_error if it cannot be used; std::system_error if it cannot be tried, for example because the process
/// ignores SIGCHLD
void try_plugin(const std::string& path, const plugin_file& file, const std::string& node, const std::string& config,
                std::chrono::milliseconds limit, const std::optional<trial_confinement>& confined = std::nullopt);

/// The message about a plugin that cannot be used: the location in the configuration, of the key that is to blame, and
/// the reason.
std::string plugin_error_message(const config& setup, std::size_t plugin, const plugin_error& why);

/// Tries all plugins, each in a child process, and stores why any cannot be used in its `trial_error`. To be called
/// before the process starts threads. \throws config_error if a required plugin cannot be used
void try_plugins(config& setup);

} // namespace cles::runtime
