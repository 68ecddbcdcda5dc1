// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include <cstddef>
#include <optional>
#include <string>

namespace tool {

/// What a program has left when it has ended.
struct finished_command {
    int status = 0;        ///< as waitpid(2) tells it
    std::string printed{}; ///< on stdout
    bool is_cut = false;   ///< it has printed more than `most_printed`
};

inline constexpr std::size_t most_printed = 1U << 20U;

/// The answer that a program stands for.
struct command_outcome {
    std::optional<cles::errc> failure{}; ///< nothing: it is a result
    std::string text{};                  ///< the result, as JSON on one line; or the message of the failure
};

/// What the exit code of a program means, as those of `cles` do, and those of sysexits.h; nothing for 0.
std::optional<cles::errc> failure_of_exit(int exit_code);

/// The result is the JSON that was printed, and {} if nothing was. The message of a failure is the first line that was
/// printed.
command_outcome outcome_of(const finished_command& command);

} // namespace tool
