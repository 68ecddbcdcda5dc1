// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"
#include "plugins/plugin_error.hpp"

#include <cstddef>
#include <string>

namespace cles::runtime {

/// What is said of a plugin that cannot be used: the place in the configuration that is to blame, its `path` or one of
/// its settings, and why.
std::string complaint_about(const config& setup, std::size_t plugin, const plugin_error& why);

/// Tries all plugins, each in a child process, and writes down which cannot be used. To be called before the process
/// has other threads. \throws config_error where such a one is required
void try_plugins(config& setup);

} // namespace cles::runtime
