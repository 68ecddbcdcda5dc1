// SPDX-License-Identifier: BSL-1.0
#include "wait_until.hpp"

#include <cerrno>
#include <ctime>

namespace cles::perf {

void wait_until(std::int64_t monotonic_ns) {
    constexpr std::int64_t second = 1'000'000'000;
    const timespec when{.tv_sec = monotonic_ns / second, .tv_nsec = monotonic_ns % second};
    while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &when, nullptr) == EINTR) {
    }
}

} // namespace cles::perf
