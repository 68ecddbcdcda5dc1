// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>

#include <sys/types.h>

namespace cles::perf {

/// The host's monotonic clock, which all its processes share.
inline std::int64_t monotonic_ns() noexcept {
    return std::chrono::nanoseconds{std::chrono::steady_clock::now().time_since_epoch()}.count();
}

/// Sleeps until `monotonic_ns` reaches this value. Returns at once if it has passed.
void wait_until(std::int64_t monotonic_ns);

/// The CPU time that a process of this host has used so far, in user mode and in the kernel.
/// \throws std::system_error if there is no such process
std::chrono::nanoseconds cpu_used(pid_t process);

} // namespace cles::perf
