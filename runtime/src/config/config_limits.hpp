// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <string>

namespace cles::runtime {

class config_node;

/// The keys of `limits`, which are the members of `cles::limits`. \throws config_error
void read_limits(const config_node& from, limits& over);

/// As YAML, a key a line, each begun with `indent`.
std::string limits_text(const limits& bounds, const std::string& indent);

} // namespace cles::runtime
