// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <vector>

namespace cles {

/// What a task says of itself; shown by `PULL node:cles` and the `cles info` command.
struct task_info {
    std::string description{};
    std::vector<std::string> parameters{}; ///< their names, in order
    bool idempotent = false;               ///< running it twice does no harm
    bool inline_ok = false;                ///< in the runtime: so quick that it may run on the I/O thread
};

} // namespace cles
