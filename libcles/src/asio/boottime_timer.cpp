// SPDX-License-Identifier: BSL-1.0
#include "asio/boottime_timer.hpp"

#include <cles/error.hpp>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>

#include <sys/timerfd.h>
#include <unistd.h>

namespace cles::asio_port {
namespace {

int make_timer() {
    const int made = ::timerfd_create(CLOCK_BOOTTIME, TFD_NONBLOCK | TFD_CLOEXEC);
    if (made < 0) {
        throw error(boost::system::error_code{errno, boost::system::system_category()}, "cannot make a timer");
    }
    return made;
}

} // namespace

boottime_timer::boottime_timer(const boost::asio::any_io_executor& executor) : timer_(executor, make_timer()) {}

void boottime_timer::set(time_point due) {
    // Zero would disarm it.
    const auto at = std::max(due.time_since_epoch(), time_point::duration{1});
    const auto whole = std::chrono::floor<std::chrono::seconds>(at);
    const itimerspec when{.it_interval = {}, .it_value = {.tv_sec = whole.count(), .tv_nsec = (at - whole).count()}};
    ::timerfd_settime(timer_.native_handle(), TFD_TIMER_ABSTIME, &when, nullptr);
}

bool boottime_timer::take() {
    std::uint64_t times = 0;
    return ::read(timer_.native_handle(), &times, sizeof times) == static_cast<ssize_t>(sizeof times);
}

void boottime_timer::cancel() {
    boost::system::error_code ignored;
    timer_.cancel(ignored);
}

} // namespace cles::asio_port
