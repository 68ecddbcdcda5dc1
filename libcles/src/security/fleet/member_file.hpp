// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>

namespace cles::security {

/// \throws security_error unless a new member may have this name
void require_member_name(std::string_view name);

/// The name of a member's file, such as `car1.pub`. Every name of a file that contains the name of a member is made
/// here. \throws security_error unless a new member may have this name
std::string member_file(std::string_view name, std::string_view suffix);

} // namespace cles::security
