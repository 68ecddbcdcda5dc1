// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace tool {

/// --pool: the pool of this command or of its node. `help` says which.
void add_pool_option(CLI::App& command, std::string& pool, const std::string& help);

/// The pool that was given; otherwise CLES_POOL, or the unnamed pool, which is empty.
std::string pool_or_variable(const std::string& given);

} // namespace tool
