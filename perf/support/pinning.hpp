// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <vector>

namespace cles::perf {

/// The processor cores that this process may run on.
std::vector<int> usable_cores();

/// Binds the calling thread to one of them.
/// \throws std::system_error
void pin_to(int core);

/// The cores of the two ends: the same one if there is only one.
struct placement {
    int client = 0;
    int server = 0;
    [[nodiscard]] bool apart() const noexcept { return client != server; }
};

placement place_ends();

} // namespace cles::perf
