// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/chrono.hpp>

#include <ctime>

namespace cles {

/// The time since the machine was booted (`CLOCK_BOOTTIME`). Like `std::chrono::steady_clock`, it does not change when
/// the system time is set; unlike that clock, it continues while the machine is suspended. A deadline that passes
/// during the suspension has expired when the machine resumes.
///
/// Its points in time have their own type. They do not convert to those of `std::chrono::steady_clock`, from which they
/// differ once the machine has been suspended.
struct boottime_clock {
    using duration = std::chrono::nanoseconds;
    using rep = duration::rep;
    using period = duration::period;
    using time_point = std::chrono::time_point<boottime_clock>;

    static constexpr bool is_steady = true;

    static time_point now() noexcept {
        std::timespec at{};
        ::clock_gettime(CLOCK_BOOTTIME, &at);
        return time_point{std::chrono::seconds{at.tv_sec} + duration{at.tv_nsec}};
    }
};

} // namespace cles
