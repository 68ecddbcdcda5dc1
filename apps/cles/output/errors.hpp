// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <exception>
#include <stdexcept>
#include <string_view>

namespace tool {

/// What scripts can rely on.
namespace exit_code {
inline constexpr int success = 0;
inline constexpr int local_failure = 1;
inline constexpr int usage = 2;
inline constexpr int not_found = 3; ///< no such target or task
inline constexpr int deadline = 4;
inline constexpr int remote_error = 5;
inline constexpr int busy = 6;
inline constexpr int signalled = 128; ///< plus the number of the signal: 130 for SIGINT
} // namespace exit_code

/// The command line is not valid.
class usage_error : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// Prints an error on stderr, as "cles: TEXT".
void print_error(std::string_view text);

/// Prints a hint or a warning on stderr, as "cles: TEXT".
void note(std::string_view text);

/// Prints the error on stderr, unless there is nothing to say. \return the exit code for it
int report_failure(const std::exception_ptr& thrown);

} // namespace tool
