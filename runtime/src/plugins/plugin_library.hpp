// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/plugin_abi.h>

#include "config/config.hpp"

#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace boost::dll {
class shared_library;
} // namespace boost::dll

/// The library of a plugin: where it is, and what it says about itself.

namespace cles::runtime {

/// Why a plugin cannot be used. `what()` is one line that begins with the plugin's path as written in the
/// configuration.
class plugin_error : public std::runtime_error {
  public:
    /// \param setting the key of the setting that is invalid, if one is; empty for all of them together
    plugin_error(const std::string& path, const std::string& why, std::optional<std::string> setting = std::nullopt)
        : std::runtime_error(path + ": " + why), setting_(std::move(setting)) {}

    [[nodiscard]] const std::optional<std::string>& setting() const noexcept { return setting_; }

  private:
    std::optional<std::string> setting_;
};

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
std::shared_ptr<const boost::dll::shared_library> open_library(const std::string& path,
                                                               const std::filesystem::path& file);

/// Calls a plugin's entry point and checks the description that it returns. \throws plugin_error
const cles_plugin& describe_plugin(const std::string& path, const boost::dll::shared_library& library);

} // namespace cles::runtime
