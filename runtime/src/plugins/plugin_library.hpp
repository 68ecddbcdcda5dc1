// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/plugin_abi.h>

#include "config/config.hpp"
#include "plugins/plugin_error.hpp"
#include "plugins/plugin_file.hpp"

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace boost::dll {
class shared_library;
} // namespace boost::dll

/// The library of a plugin: where it is, and what it says about itself.

namespace cles::runtime {

/// The file of a plugin: a path that names a folder is used as it is; a bare name is searched for in the folders, in
/// order. \throws plugin_error if there is no such file, naming the folders
std::filesystem::path find_plugin(const std::string& path, const std::vector<std::filesystem::path>& folders);

/// Where this build installs plugins, relative to the program: `../lib/cles`, `../lib/x86_64-linux-gnu/cles`.
extern const char* const installed_plugins;

/// The folders of the plugins that come with a program: where they are installed, and next to it in its build tree.
std::vector<std::filesystem::path> default_plugin_folders(const std::filesystem::path& program,
                                                          const std::filesystem::path& installed = installed_plugins);

/// The path of a configured plugin: a relative path that names a folder begins at the folder of the configuration file;
/// a bare name stays one.
std::string resolve_plugin_path(const config& setup, const plugin_config& wanted);

/// The folders to search for bare names: `plugin_path`, then those of the plugins that come with this program.
std::vector<std::filesystem::path> plugin_search_path(const config& setup);

/// Loads a plugin's library, which runs its initialization. \param path as written in the configuration
/// \throws plugin_error
std::shared_ptr<const boost::dll::shared_library> open_library(const std::string& path, const plugin_file& file);

/// Calls a plugin's entry point and checks the description that it returns. \throws plugin_error
const cles_plugin& describe_plugin(const std::string& path, const boost::dll::shared_library& library);

} // namespace cles::runtime
