// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <functional>

namespace CLI {
class App;
} // namespace CLI

namespace dsgd {

/// Adds the command `rounds`. If it is given, `chosen` becomes what runs it, and returns the exit code.
void add_rounds_command(CLI::App& to, std::function<int()>& chosen);

} // namespace dsgd
