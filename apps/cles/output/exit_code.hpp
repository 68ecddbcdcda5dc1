// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

/// What scripts learn from the command without reading a word.
namespace tool::exit_code {

inline constexpr int success = 0;
inline constexpr int local_failure = 1;
inline constexpr int usage = 2;
inline constexpr int not_found = 3; ///< no such target or task
inline constexpr int deadline = 4;
inline constexpr int remote_error = 5;
inline constexpr int busy = 6;
inline constexpr int signalled = 128; ///< and the signal's number: 130 for SIGINT

int of(const cles::error& failure);

} // namespace tool::exit_code
