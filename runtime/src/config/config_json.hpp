// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace cles::runtime {

/// A plugin's part of the configuration as JSON: a map or a list; nothing is `{}`. What is not quoted and reads as a
/// number, true, false or null in JSON is one; all else is text.
/// \throws bad_value where it is neither, nests deeper than 32, or makes more than 1 MiB
std::string json_of(const YAML::Node& value);

} // namespace cles::runtime
