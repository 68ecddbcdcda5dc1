// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

struct stat;

/// Who can change a file. Messages name what is wrong, and the command that mends it.

namespace cles::security {

/// For commands that a message proposes.
std::string shell_quoted(std::string_view text);

/// The name, or else the number.
std::string user_name(std::uint32_t user);

/// What is wrong if the file belongs neither to this user nor to root; empty if nothing is.
std::string owner_flaw(const struct stat& status, const std::string& path);

/// What is wrong if the group or others may write; empty if nothing is.
std::string mode_flaw(const struct stat& status, const std::string& path);

} // namespace cles::security
