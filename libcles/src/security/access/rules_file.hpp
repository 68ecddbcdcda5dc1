// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/access/local_rules.hpp"
#include "security/fleet/protected_folder.hpp"

namespace cles::security {

/// Reads `rules` in a node's directory. Without this file there are no rules; if it cannot be read, belongs to another
/// user, or has an error, the result denies everything.
[[nodiscard]] local_rules read_local_rules(const protected_folder& folder);

} // namespace cles::security
