// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"

#include <string>

namespace cles::runtime {

/// The whole configuration as a file would say it, with a comment on each value that is no default: where it comes
/// from. Read again it says the same.
std::string to_yaml(const config& whole);

} // namespace cles::runtime
