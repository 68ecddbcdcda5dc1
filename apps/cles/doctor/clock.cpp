// SPDX-License-Identifier: BSL-1.0
#include "doctor/checks.hpp"
#include "output/statistics.hpp"

#include <chrono>
#include <ctime>
#include <string>

#include <sys/timex.h>

namespace tool {
namespace {

void check_time_of_day(findings& found) {
    using namespace std::chrono;
    const auto today = sys_days{floor<days>(system_clock::now())};
    if (today < sys_days{year{2020} / 1 / 1}) {
        found.push_back({"clock", verdict::failure, "the clock of this host has never been set",
                         "set it: times in what nodes publish mean nothing"});
        return;
    }
    timex state{};
    const int answer = ::adjtimex(&state);
    if (answer == -1) {
        found.push_back({"clock", verdict::ok, "the system does not tell whether the clock is synchronised"});
    } else if (answer == TIME_ERROR || (state.status & STA_UNSYNC) != 0) {
        found.push_back({"clock", verdict::warning, "nothing on this host keeps its clock synchronised",
                         "run chrony, ntpd, ptp4l or systemd-timesyncd where times of several hosts are compared; "
                         "requests and deadlines do not need it"});
    } else {
        const auto most_ms = static_cast<double>(state.maxerror) / 1000;
        found.push_back({"clock", verdict::ok, "synchronised, off by " + fixed(most_ms, 1) + " ms at most"});
    }
}

void check_resolution(findings& found) {
    constexpr long coarse_ns = 1'000'000;
    timespec resolution{};
    if (::clock_getres(CLOCK_MONOTONIC, &resolution) == 0 &&
        (resolution.tv_sec != 0 || resolution.tv_nsec > coarse_ns)) {
        found.push_back({"clock", verdict::warning, "timers of this host are coarser than a millisecond",
                         "boot a kernel with high resolution timers, else deadlines are late"});
    }
}

} // namespace

void check_clock(findings& found) {
    check_time_of_day(found);
    check_resolution(found);
}

} // namespace tool
