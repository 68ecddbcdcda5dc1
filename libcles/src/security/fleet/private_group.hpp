// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

struct stat;

namespace cles::security {

struct user_entry {
    std::string name{};
    std::uint32_t group = 0; ///< the primary one
};

struct group_entry {
    std::string name{};
    std::uint32_t id = 0;
    std::vector<std::string> members{}; ///< besides those whose primary group it is
};

/// Whether the group is the owner's own one, as many systems create it for each user, and nobody else is in it.
/// \param users those that the system lists
bool is_private_group(const group_entry& group, const user_entry& owner, const std::vector<user_entry>& users);

/// Whether the file's group is the private one of its owner, as the system's database has it.
bool has_private_group(const struct stat& status);

} // namespace cles::security
