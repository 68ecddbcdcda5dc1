// SPDX-License-Identifier: BSL-1.0
#include <cles/limits.hpp>

#include "doctor/checks.hpp"
#include "output/statistics.hpp"

#include <chrono>
#include <ctime>
#include <string>

#include <sys/resource.h>
#include <sys/timex.h>

namespace tool {
namespace {

void check_time_of_day(findings& found) {
    using namespace std::chrono;
    const auto today = sys_days{floor<days>(system_clock::now())};
    if (today < sys_days{year{2020} / 1 / 1}) {
        found.failure("clock", "the clock of this host has never been set",
                      "set it: otherwise the times that nodes publish are meaningless");
        return;
    }
    timex state{};
    const int answer = ::adjtimex(&state);
    if (answer == -1) {
        found.ok("clock", "the system does not report whether the clock is synchronised");
    } else if (answer == TIME_ERROR || (state.status & STA_UNSYNC) != 0) {
        found.warning("clock", "the clock of this host is not synchronised",
                      "run chrony, ntpd, ptp4l or systemd-timesyncd if times of several hosts are compared; "
                      "requests and deadlines do not need it");
    } else {
        const auto max_ms = static_cast<double>(state.maxerror) / 1000;
        found.ok("clock", "synchronised, off by " + fixed(max_ms, 1) + " ms at most");
    }
}

void check_resolution(findings& found) {
    constexpr long max_ns = 1'000'000;
    timespec resolution{};
    if (::clock_getres(CLOCK_MONOTONIC, &resolution) == 0 && (resolution.tv_sec != 0 || resolution.tv_nsec > max_ns)) {
        found.warning("clock", "the timers of this host are coarser than a millisecond",
                      "boot a kernel with high resolution timers; otherwise deadlines are late");
    }
}

} // namespace

void check_clock(findings& found) {
    check_time_of_day(found);
    check_resolution(found);
}

void check_limits(findings& found) {
    constexpr rlim_t other_files = 64; // listeners, files, libraries
    rlimit files{};
    if (::getrlimit(RLIMIT_NOFILE, &files) != 0) {
        return;
    }
    const rlim_t needed = cles::limits{}.links + other_files;
    const auto text = "a program may open " +
                      (files.rlim_cur == RLIM_INFINITY ? "any number of" : std::to_string(files.rlim_cur)) + " files";
    if (files.rlim_cur < needed) {
        found.warning("limits", text + ", which is fewer than the links of a node",
                      "ulimit -n " + std::to_string(needed) +
                          ", or LimitNOFILE= in the unit file, if that many clients are expected");
    } else {
        found.ok("limits", text);
    }
}

} // namespace tool
