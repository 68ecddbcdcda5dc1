// SPDX-License-Identifier: BSL-1.0
#include "commands/started_program.hpp"

#include <cerrno>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include <unistd.h>

namespace tool {

void start_program(char** words, std::string_view command, std::string program, const std::string& advice) {
    while (std::string_view{*words} != command) {
        ++words; // a flag of `cles`
    }
    *words = program.data();
    std::error_code unknown;
    const auto self = std::filesystem::read_symlink("/proc/self/exe", unknown);
    int failure = ENOENT;
    if (!unknown) {
        ::execv((self.parent_path() / program).c_str(), words);
        failure = errno;
    }
    if (failure == ENOENT) {
        ::execvp(program.c_str(), words);
        failure = errno;
    }
    throw std::runtime_error(failure == ENOENT
                                 ? "cannot find " + program + ", neither beside cles nor in PATH: " + advice
                                 : "cannot start " + program + ": " + std::generic_category().message(failure));
}

} // namespace tool
