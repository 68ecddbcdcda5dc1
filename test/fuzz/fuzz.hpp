// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

/// What every target defines, and what it says with.

namespace cles::fuzz {

/// Does with the input what the target is for, and ends the program where it finds what must not be.
void run(std::string_view input);

/// Ends the program, saying why, unless it holds.
inline void require(bool holds, std::string_view what, std::string_view about = {}) {
    if (!holds) {
        const std::string text = "\nit does not hold that " + std::string{what} +
                                 (about.empty() ? std::string{} : ": '" + std::string{about} + "'") + "\n";
        std::fwrite(text.data(), 1, text.size(), stderr);
        std::abort();
    }
}

} // namespace cles::fuzz
