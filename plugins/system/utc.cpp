// SPDX-License-Identifier: BSL-1.0
#include "utc.hpp"

#include <array>
#include <chrono>
#include <cstdio>

namespace sysinfo {

utc utc_at(std::int64_t nanoseconds) {
    using namespace std::chrono;
    const sys_time<std::chrono::nanoseconds> when{std::chrono::nanoseconds{nanoseconds}};
    const auto day = floor<days>(when);
    const year_month_day date{day};
    const hh_mm_ss time{floor<microseconds>(when - day)};
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "%04d-%02u-%02uT%02d:%02d:%02d.%06dZ", static_cast<int>(date.year()),
                  static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                  static_cast<int>(time.hours().count()), static_cast<int>(time.minutes().count()),
                  static_cast<int>(time.seconds().count()), static_cast<int>(time.subseconds().count()));
    const auto micros = floor<microseconds>(when).time_since_epoch().count(); // a double holds no more digits
    return {.seconds = static_cast<double>(micros) / 1e6, .text = text.data()};
}

utc read_utc() { return utc_at(std::chrono::nanoseconds{std::chrono::system_clock::now().time_since_epoch()}.count()); }

} // namespace sysinfo
