// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/private_group.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <optional>
#include <utility>
#include <vector>

#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>

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
