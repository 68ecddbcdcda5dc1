// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"

#include <string>

namespace cles::runtime {

/// Puts what a configuration in YAML says over what is there.
/// \param name how complaints call it
/// \throws config_error naming file, line and the key's full path
void read_config(const std::string& text, const std::string& name, config& over);

/// The same, of a file. \throws config_error also where it cannot be read, or has more than 1 MiB
void read_config_file(const std::string& path, config& over);

/// The whole configuration as a file would say it, with a comment on each value that is no default: where it comes
/// from. Read again it says the same.
std::string to_yaml(const config& whole);

} // namespace cles::runtime
