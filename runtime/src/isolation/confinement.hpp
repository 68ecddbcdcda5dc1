// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace cles::runtime {

/// What the process of an isolated plugin may use.
struct confinement {
    std::uint64_t memory = 1U << 30U; ///< bytes that it may write to: heap, data and stacks
    std::uint64_t open_files = 256;
    /// Files and folders that it may read, besides those of the system, and the plugin's own file. Absolute paths.
    std::vector<std::string> readable{};
    std::vector<std::string> writable{}; ///< the same for reading and writing: data, and devices
    std::size_t threads = 8;             ///< that the daemon's own code starts there
};

/// Confines the calling thread, all that it starts, and, for the limits on resources, the whole process: limits, no
/// privileges and no new ones, and where the kernel has them, Landlock for files and signals and a filter of system
/// calls. This cannot be undone. \param plugin the plugin's file \return what is in force and what is not, for the log
/// \throws std::system_error if a limit cannot be set, or a configured path cannot be opened
std::string confine(const confinement& to, const std::filesystem::path& plugin);

} // namespace cles::runtime
