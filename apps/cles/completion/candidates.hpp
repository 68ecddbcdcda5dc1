// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "completion/candidate.hpp"
#include "completion/cursor.hpp"

#include <vector>

namespace tool {

// What may be typed at a place without asking any node. Nothing is left out yet for what has been typed.

/// The commands of the program.
std::vector<candidate> commands_of(CLI::App& app);

/// The options of the cursor's command, and the program's.
std::vector<candidate> options_at(CLI::App& app, const cursor& here);

/// The values of an option, where they can be known: words, interfaces, files.
std::vector<candidate> values_at(const cursor& here);

} // namespace tool
