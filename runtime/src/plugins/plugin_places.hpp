// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace cles::runtime {

/// The file of a plugin as the configuration means it: a path with a folder in it that is not absolute begins where the
/// configuration file is. A bare name stays one.
std::string plugin_file(const config& setup, const plugin_config& wanted);

/// Where bare names are looked for: `plugin_path`, then where plugins lie that came with this program.
std::vector<std::filesystem::path> plugin_folders(const config& setup);

} // namespace cles::runtime
