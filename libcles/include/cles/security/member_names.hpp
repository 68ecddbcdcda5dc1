// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>

/// Names of members become names of files and folders: `car1.pub`, `car1.join`, and the folder of a node that is
/// created together with its fleet. Nodes may have other names; members that are created or added may not.

namespace cles::security {

/// What keeps a name from being that of a new member; empty if it is valid.
std::string flaw_of_member_name(std::string_view name);

/// The path of a member's own folder in another one, such as that of the fleet's authority.
/// \throws std::runtime_error with a message for people, unless the name can be that of such a folder
std::string member_folder(const std::string& directory, std::string_view name);

} // namespace cles::security
