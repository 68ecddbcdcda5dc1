// SPDX-License-Identifier: BSL-1.0
// Preloaded, it sets the wall clock of a process to the beginning of 1970, as on a device without a battery.
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

namespace {
constexpr time_t now{30};
}

extern "C" {

int clock_gettime(clockid_t which, timespec* into) noexcept {
    if (which == CLOCK_REALTIME || which == CLOCK_REALTIME_COARSE) {
        *into = {.tv_sec = now, .tv_nsec = 0};
        return 0;
    }
    return static_cast<int>(syscall(SYS_clock_gettime, which, into));
}

int gettimeofday(timeval* into, void*) noexcept {
    *into = {.tv_sec = now, .tv_usec = 0};
    return 0;
}

time_t time(time_t* into) noexcept {
    if (into != nullptr) {
        *into = now;
    }
    return now;
}
}
