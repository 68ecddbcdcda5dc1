// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <vector>

namespace cles::runtime {

/// The variables of the daemon that the process of an isolated plugin gets: those of the system and its libraries. The
/// others may contain secrets. For `posix_spawn`: ends with a null pointer.
std::vector<char*> plugin_environment();

} // namespace cles::runtime
