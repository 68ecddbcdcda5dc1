// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace tool {

/// What the program does, with all commands.
std::string overview_of(const CLI::App& app);

/// Says on stderr that there is no such command, and which one was probably meant.
void refuse_command(const CLI::App& app, const std::string& typed);

/// Says on stderr which of its options was probably meant, where one of these words looks like an option.
void suggest_option(const CLI::App& app, const CLI::App& command, const std::string& word);

} // namespace tool
