// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>

#include <sys/types.h>

namespace cles::perf {

/// What a process of this host has used of its processors so far, in user mode and in the kernel, to the nanosecond.
/// \throws std::system_error where there is no such process
std::chrono::nanoseconds cpu_used(pid_t process);

} // namespace cles::perf
