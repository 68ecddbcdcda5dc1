// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/verb.hpp>

#include <chrono>
#include <string>

/// What the options of one operation may be.

namespace cles::shell {

/// Which option is not what it may be, and why; empty where none is.
[[nodiscard]] std::string objection_to(const call_options& options);
[[nodiscard]] std::string objection_to(const bind_options& options);

/// How long an operation may take that was given this deadline: the verb's default where it is 0, and a day at most.
[[nodiscard]] std::chrono::milliseconds time_limit(std::chrono::milliseconds deadline, verb of);

} // namespace cles::shell
