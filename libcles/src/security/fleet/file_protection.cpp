// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/file_protection.hpp"

#include <array>

#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

namespace cles::security {

std::string shell_quoted(std::string_view text) {
    constexpr std::string_view plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./+@:,";
    if (text.find_first_not_of(plain) == std::string_view::npos && !text.starts_with('-')) {
        return std::string{text};
    }
    std::string quoted{"'"};
    for (const auto c : text) {
        if (c == '\'') {
            quoted += "'\\''";
        } else {
            quoted.push_back(c);
        }
    }
    return quoted + "'";
}

std::string user_name(std::uint32_t user) {
    passwd entry{};
    passwd* found = nullptr;
    std::array<char, 4096> buffer{};
    if (getpwuid_r(user, &entry, buffer.data(), buffer.size(), &found) == 0 && found != nullptr) {
        return found->pw_name;
    }
    return std::to_string(user);
}

std::string owner_flaw(const struct stat& status, const std::string& path) {
    const auto me = geteuid();
    if (status.st_uid == me || status.st_uid == 0) {
        return {};
    }
    const auto own = user_name(me);
    return path + " belongs to the user " + user_name(status.st_uid) + ", not to " + own + (me == 0 ? "" : " or root") +
           ": chown " + own + " " + shell_quoted(path);
}

std::string mode_flaw(const struct stat& status, const std::string& path) {
    if ((status.st_mode & (S_IWGRP | S_IWOTH)) == 0) {
        return {};
    }
    return path + " can be changed by other users: chmod go-w " + shell_quoted(path);
}

} // namespace cles::security
