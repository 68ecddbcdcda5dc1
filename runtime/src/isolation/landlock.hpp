// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cles::runtime {

/// Which files a process may use. Nothing else can be opened, executed or changed.
struct file_access {
    std::vector<std::filesystem::path> system_readable{};
    std::vector<std::filesystem::path> system_writable{};
    std::vector<std::string> readable{};
    std::vector<std::string> writable{};
};

struct file_limits {
    int version = 0; ///< of Landlock; 0 if the kernel has none, and then nothing is limited
    /// Those that cannot be opened, and why; not those of the system.
    std::vector<std::string> missing_readable{};
    std::vector<std::string> missing_writable{};
};

/// Limits the files of the calling thread and of what it starts to these, and its signals and abstract Unix sockets to
/// processes that are limited with it. \pre no new privileges
/// \throws std::system_error if the limits cannot be set
file_limits limit_files(const file_access& to);

} // namespace cles::runtime
