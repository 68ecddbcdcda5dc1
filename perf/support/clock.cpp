// SPDX-License-Identifier: BSL-1.0
#include "clock.hpp"

#include <cerrno>
#include <ctime>
#include <system_error>

namespace cles::perf {

void wait_until(std::int64_t monotonic_ns) {
    constexpr std::int64_t second = 1'000'000'000;
    const timespec when{.tv_sec = monotonic_ns / second, .tv_nsec = monotonic_ns % second};
    while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &when, nullptr) == EINTR) {
    }
}

std::chrono::nanoseconds cpu_used(pid_t process) {
    clockid_t clock{};
    if (const int code = ::clock_getcpuclockid(process, &clock); code != 0) {
        throw std::system_error(code, std::generic_category(), "clock_getcpuclockid");
    }
    timespec used{};
    if (::clock_gettime(clock, &used) != 0) {
        throw std::system_error(errno, std::generic_category(), "clock_gettime");
    }
    return std::chrono::seconds{used.tv_sec} + std::chrono::nanoseconds{used.tv_nsec};
}

} // namespace cles::perf
