// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cles::test {

/// Whether `text` is what `pattern` says, `...` in it standing for anything.
bool fits(std::string_view pattern, std::string_view text);

/// Performs a script's steps on a fresh node and compares what comes with what it expects. Each difference is a line
/// that says where; none: the node talks as the script says.
std::vector<std::string> replay(std::string_view script);

} // namespace cles::test
