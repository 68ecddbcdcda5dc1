// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cles::runtime {

/// Which files a process may use. Nothing else can be opened, executed or changed.
struct file_access {
    std::vector<std::filesystem::path> readable{}; ///< missing ones are left out
    std::vector<std::filesystem::path> writable{}; ///< missing ones are left out
    std::vector<std::string> required_readable{};
    std::vector<std::string> required_writable{};
};

/// Limits the files of the calling thread and of what it starts to these, and its signals to processes that are limited
/// with it. \pre no new privileges
/// \return the version of Landlock; 0 if the kernel has none, and then nothing is limited
/// \throws std::system_error if a required path cannot be opened
int limit_files(const file_access& to);

} // namespace cles::runtime
