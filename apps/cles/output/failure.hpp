// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <exception>
#include <stdexcept>

namespace tool {

/// The command line asks for something that cannot be.
class usage_error : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// The reader of the output has gone, as `head` does when it has seen enough: a reason to end, not to complain.
class output_closed : public std::exception {
  public:
    [[nodiscard]] const char* what() const noexcept override { return "nobody reads the output"; }
};

/// A write was interrupted by a signal.
class output_interrupted : public std::exception {
  public:
    [[nodiscard]] const char* what() const noexcept override { return "interrupted"; }
};

/// Says on stderr what went wrong, where there is something to say, and gives the exit code for it.
int report_failure(const std::exception_ptr& thrown);

} // namespace tool
