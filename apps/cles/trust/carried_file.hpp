// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace tool {

/// The line in a file that was carried here, such as car1.pub; "-" is stdin.
/// \throws usage_error if it cannot be read, or is longer than a roster can be
std::string read_carried_file(const std::string& name);

/// How messages name it.
std::string carried_file_name(const std::string& name);

} // namespace tool
