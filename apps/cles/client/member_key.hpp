// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include <string>
#include <utility>
#include <vector>

namespace tool {

/// Makes the service the member of a fleet whose key is in this directory: sets its security and its name.
/// \param local_users other users of this host, by name or id, and which member each is
/// \throws std::runtime_error that says what is wrong in the directory, and what corrects it
/// \throws usage_error if there is no such user, or if one is stated to be two members
void use_member_key(cles::service_options& options, const std::string& directory,
                    const std::vector<std::pair<std::string, std::string>>& local_users = {});

/// Options of a service with the key in that directory, and its name; without a directory, with this name.
/// \throws std::runtime_error as above
cles::service_options options_of_member(const std::string& name, const std::string& directory);

/// The name of the key in this directory.
/// \throws std::runtime_error as above
std::string name_of_member(const std::string& directory);

} // namespace tool
