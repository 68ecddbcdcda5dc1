// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"
#include "plugins/plugin_search.hpp"

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <string>

namespace cles::runtime {

/// Loads a plugin in a child process, calls its entry point, and has it check its settings; its tasks are not
/// registered.
///
/// What a library runs then cannot be guarded against in the process that runs it: an exception out of a constructor of
/// a global object ends the process, and so does a crash, and what never returns holds it. What the child wrote last is
/// part of what is thrown. Costs a few milliseconds. To be called before the process has other threads: the child is a
/// copy of this thread alone, in which a lock that another one holds is never released.
///
/// \param path as the configuration names it \param file where it is \param config its settings, a JSON object
/// \throws plugin_error where it cannot be used; std::system_error where it cannot be tried, as in a process that
/// ignores SIGCHLD and so never learns how its children end
void try_plugin(const std::string& path, const std::filesystem::path& file, const std::string& node,
                const std::string& config, std::chrono::milliseconds limit);

/// What is said of a plugin that cannot be used: the place in the configuration that is to blame, its `path` or one of
/// its settings, and why.
std::string complaint_about(const config& setup, std::size_t plugin, const plugin_error& why);

/// Tries all plugins, each in a child process, and writes down which cannot be used. To be called before the process
/// has other threads. \throws config_error where such a one is required
void try_plugins(config& setup);

} // namespace cles::runtime
