// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "isolation/isolation_limits.hpp"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace cles::runtime {

struct confinement_report {
    std::string in_force;               ///< for the log
    std::vector<std::string> missing{}; ///< what does not limit the process, or cannot be used by it, and why
};

/// Confines the calling thread, all that it starts, and, for the limits on resources, the whole process: limits, no
/// privileges and no new ones, and where the kernel has them, Landlock for files, signals and sockets and a filter of
/// system calls. This cannot be undone. \param threads that the daemon's own code starts there
/// \param plugin the plugin's file \param require_paths whether all paths of the limits have to exist
/// \throws plugin_error if one of these does not; std::system_error if a limit cannot be set
confinement_report confine(const isolation_limits& to, std::size_t threads, const std::filesystem::path& plugin,
                           bool require_paths);

} // namespace cles::runtime
