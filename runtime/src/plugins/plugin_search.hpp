// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace cles::runtime {

/// Why a plugin cannot be used. `what()` begins with its path, as the configuration names it, and says the rest in one
/// line.
class plugin_error : public std::runtime_error {
  public:
    /// \param setting where one of its settings is to blame: that one's key, empty for all of them together
    plugin_error(const std::string& path, const std::string& why, std::optional<std::string> setting = std::nullopt)
        : std::runtime_error(path + ": " + why), setting_(std::move(setting)) {}

    [[nodiscard]] const std::optional<std::string>& setting() const noexcept { return setting_; }

  private:
    std::optional<std::string> setting_;
};

/// The file of a plugin. A path with a folder in it is taken as it is; a bare name is looked for in the folders, in
/// their order.
/// \throws plugin_error where there is no such file, naming the folders
std::filesystem::path find_plugin(const std::string& path, const std::vector<std::filesystem::path>& folders);

/// Where this build installs plugins, from the folder of the program: `../lib/cles`, `../lib/x86_64-linux-gnu/cles`.
extern const char* const installed_plugins;

/// Where plugins lie that came with a program: where it was installed, and beside it in the tree that it was built in.
std::vector<std::filesystem::path> plugin_folders_of(const std::filesystem::path& program,
                                                     const std::filesystem::path& installed = installed_plugins);

/// The file of a plugin as the configuration means it: a path with a folder in it that is not absolute begins where the
/// configuration file is. A bare name stays one.
std::string plugin_file(const config& setup, const plugin_config& wanted);

/// Where bare names are looked for: `plugin_path`, then where plugins lie that came with this program.
std::vector<std::filesystem::path> plugin_folders(const config& setup);

} // namespace cles::runtime
