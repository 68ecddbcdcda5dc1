// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "completion/candidates.hpp"

#include <string>
#include <vector>

namespace tool {

/// The members in the roster of --keys, each followed by `suffix`; none if it cannot be read.
/// \param words what was typed before
std::vector<candidate> member_candidates(std::vector<std::string> words, const std::string& suffix);

} // namespace tool
