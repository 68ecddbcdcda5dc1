// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "completion/cursor.hpp"

#include <string>
#include <vector>

namespace tool {

/// Something that may be typed next. If it ends in ':', '/', '=' or '@', more follows without a space.
struct candidate {
    std::string text;
    std::string description{};
};

// The candidates that are known without asking any node, regardless of what has been typed so far.

/// The commands of the program, or those of a command that has some.
std::vector<candidate> commands_of(CLI::App& app);

/// The options of the cursor's command, and those of the program.
std::vector<candidate> options_at(CLI::App& app, const cursor& cursor);

/// The values of an option, as far as they are known: keywords, interfaces, files.
std::vector<candidate> values_at(const cursor& cursor);

} // namespace tool
