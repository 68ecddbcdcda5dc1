// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cles::runtime {

/// The file of a plugin. A path with a folder in it is taken as it is; a bare name is looked for in the folders, in
/// their order.
/// \throws plugin_error where there is no such file, naming the folders
std::filesystem::path find_plugin(const std::string& path, const std::vector<std::filesystem::path>& folders);

/// Where this build installs plugins, from the folder of the program: `../lib/cles`, `../lib/x86_64-linux-gnu/cles`.
extern const char* const installed_plugins;

/// Where plugins lie that came with a program: where it was installed, and beside it in the tree that it was built in.
std::vector<std::filesystem::path> plugin_folders_of(const std::filesystem::path& program,
                                                     const std::filesystem::path& installed = installed_plugins);

} // namespace cles::runtime
