// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/file_protection.hpp"

#include <cles/security/local_user.hpp>

#include "security/keys/keys.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <optional>
#include <system_error>
#include <utility>

#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

namespace cles::security {
namespace {

constexpr std::size_t entry_size = 16384; // longer entries count as unknown

user_entry entry_of(const passwd& from) { return {.name = from.pw_name, .group = from.pw_gid}; }

std::optional<user_entry> find_user(uid_t id) {
    passwd entry{};
    passwd* found = nullptr;
    std::array<char, entry_size> buffer{};
    if (getpwuid_r(id, &entry, buffer.data(), buffer.size(), &found) != 0 || found == nullptr) {
        return {};
    }
    return entry_of(entry);
}

std::optional<group_entry> find_group(gid_t id) {
    group entry{};
    group* found = nullptr;
    std::array<char, entry_size> buffer{};
    if (getgrgid_r(id, &entry, buffer.data(), buffer.size(), &found) != 0 || found == nullptr) {
        return {};
    }
    group_entry made{.name = entry.gr_name, .id = entry.gr_gid};
    for (char** member = entry.gr_mem; *member != nullptr; ++member) {
        made.members.emplace_back(*member);
    }
    return made;
}

// Nothing if they cannot all be listed.
std::optional<std::vector<user_entry>> all_users() {
    std::vector<user_entry> users;
    passwd entry{};
    passwd* found = nullptr;
    std::array<char, entry_size> buffer{};
    setpwent();
    int why = 0;
    while ((why = getpwent_r(&entry, buffer.data(), buffer.size(), &found)) == 0 && found != nullptr) {
        users.push_back(entry_of(entry));
    }
    endpwent();
    return why == 0 || why == ENOENT ? std::optional{std::move(users)} : std::nullopt;
}

} // namespace

descriptor::descriptor(descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

descriptor& descriptor::operator=(descriptor&& other) noexcept {
    descriptor closed{std::exchange(fd_, std::exchange(other.fd_, -1))};
    return *this;
}

int descriptor::release() noexcept { return std::exchange(fd_, -1); }

descriptor::~descriptor() {
    if (is_open()) {
        close(fd_);
    }
}

void fail_with(int code, const std::string& what) {
    throw security_error{what + ": " + std::generic_category().message(code)};
}

struct stat status_of(const descriptor& file, const std::string& path) {
    struct stat status {};
    if (fstat(file.get(), &status) != 0) {
        fail_with(errno, "cannot examine " + path);
    }
    return status;
}

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

std::optional<std::uint32_t> id_of_user(const std::string& user) {
    std::uint32_t number = 0;
    const auto* const end = user.data() + user.size();
    if (const auto read = std::from_chars(user.data(), end, number); read.ec == std::errc{} && read.ptr == end) {
        return number;
    }
    passwd entry{};
    passwd* found = nullptr;
    std::array<char, entry_size> buffer{};
    if (getpwnam_r(user.c_str(), &entry, buffer.data(), buffer.size(), &found) != 0 || found == nullptr) {
        return {};
    }
    return entry.pw_uid;
}

std::string user_name(std::uint32_t user) {
    const auto known = find_user(user);
    return known ? known->name : std::to_string(user);
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

bool is_private_group(const group_entry& group, const user_entry& owner, const std::vector<user_entry>& users) {
    const auto is_owner = [&](const std::string& name) { return name == owner.name; };
    return group.name == owner.name && group.id == owner.group && std::ranges::all_of(group.members, is_owner) &&
           std::ranges::all_of(users,
                               [&](const user_entry& each) { return each.group != group.id || is_owner(each.name); });
}

bool has_private_group(const struct stat& status) {
    const auto owner = find_user(status.st_uid);
    const auto group = find_group(status.st_gid);
    const auto users = all_users();
    return owner && group && users && is_private_group(*group, *owner, *users);
}

} // namespace cles::security
