// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

/// What every target defines, and its functions for failures.

namespace cles::fuzz {

/// Processes the input, and ends the program if an invariant is violated.
void run(std::string_view input);

/// Ends the program with this reason unless the condition holds.
inline void require(bool holds, std::string_view what, std::string_view about = {}) {
    if (!holds) {
        const std::string text = "\nit does not hold that " + std::string{what} +
                                 (about.empty() ? std::string{} : ": '" + std::string{about} + "'") + "\n";
        std::fwrite(text.data(), 1, text.size(), stderr);
        std::abort();
    }
}

} // namespace cles::fuzz
