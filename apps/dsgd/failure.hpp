// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include <string>

namespace dsgd {

/// Says on stderr why the program ends, and returns its exit code.
int report_failure(const cles::error& why);
/// Says on stderr what is not good about a result, if anything is, and returns the exit code.
int report_shortcoming(const std::string& text);

} // namespace dsgd
