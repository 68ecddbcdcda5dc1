// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <ctime>

namespace cles {

/// The time since the machine was started. Like `std::chrono::steady_clock`, no clock of the day moves it; unlike that
/// one, it goes on while the machine is suspended. So a deadline that passes while a laptop's lid is closed has passed
/// when it is opened.
///
/// Its points in time are a type of their own: they cannot be mixed up with those of `std::chrono::steady_clock`, which
/// differ from them once the machine has been suspended.
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
