// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"

#include <string>
#include <vector>

namespace cles::runtime {

/// Reads a configuration in YAML. It replaces the values in `into` that it contains.
/// \param name of the file, for messages
/// \throws config_error naming file, line and full key
void read_config(const std::string& text, const std::string& name, config& into);

/// The same for a file. \throws config_error also if it cannot be read, or is larger than 1 MiB
void read_config_file(const std::string& path, config& into);

/// A value from the environment or from a flag, which overrides that of the file.
struct setting_override {
    std::string key;
    std::vector<std::string> texts; ///< one, or those of a list
    std::string source;             ///< "CLES_NODE", "--node"
};
using overrides = std::vector<setting_override>;

/// \throws config_error naming the variable or flag
void apply_overrides(const overrides& wanted, config& into);

/// The complete configuration as YAML, with a comment after each value that is not a default: where it comes from.
/// `read_config` reads it back.
std::string to_yaml(const config& setup);

} // namespace cles::runtime
