// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace cles::security {

/// The id of a user of this host, by name or number, as `security_options::local_users` needs it; nothing if there is
/// no such user.
std::optional<std::uint32_t> id_of_user(const std::string& user);

} // namespace cles::security
