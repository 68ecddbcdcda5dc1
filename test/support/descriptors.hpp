// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <system_error>

#include <fcntl.h>

namespace cles::test {

/// The descriptors of this process that a program which it starts would inherit, as "7 socket:[4711]".
inline std::set<std::string> inherited_descriptors() {
    std::set<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator{"/proc/self/fd"}) {
        const auto name = entry.path().filename().string();
        const int flags = ::fcntl(std::stoi(name), F_GETFD);
        std::error_code gone;
        const auto target = std::filesystem::read_symlink(entry.path(), gone).string();
        if (flags >= 0 && (flags & FD_CLOEXEC) == 0 && !gone) {
            found.insert(name + " " + target);
        }
    }
    return found;
}

} // namespace cles::test
