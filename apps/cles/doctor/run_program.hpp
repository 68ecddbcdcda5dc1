// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <string>
#include <vector>

namespace tool {

/// How a program ended, and what it said on stdout and stderr together, as far as it is not too much.
struct program_end {
    int code = -1; ///< -1: a signal or the limit ended it
    std::string text;
};

/// Runs a program and waits for it; one that takes longer than the limit is killed.
/// \param arguments the first is its path
/// \throws std::system_error where it cannot be started
program_end run_program(const std::vector<std::string>& arguments, std::chrono::milliseconds limit);

/// Where the program of that name is: in the path, or else beside this one. Empty where it is not.
std::string find_program(const std::string& name);

} // namespace tool
