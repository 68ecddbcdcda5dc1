// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/chrono.hpp>
#include <cles/convert.hpp>

#include <cstdint>
#include <ratio>
#include <string_view>
#include <type_traits>
#include <utility>

/// Conversion of durations and of points in time of the system clock; included by `<cles/service.hpp>` and
/// `<cles/registrar.hpp>`.
///
/// Writes ISO 8601 with up to nanoseconds: a duration as "PT90.5S", a point in time in UTC as
/// "2026-11-23T07:43:14.25Z". Reads the same, durations with weeks, days, hours and minutes ("P1DT12H"), other time
/// zones ("2026-11-23T08:43:14.25+01:00"), and numbers of seconds (for a point in time, since 1970). Values are rounded
/// down to the resolution of the type. Floating-point durations keep every digit. Points in time of other clocks do not
/// convert, because they mean nothing to another node.

namespace cles {

namespace detail {

/// A time with the range and resolution of the protocol.
struct whole_time {
    std::int64_t seconds = 0;
    std::int64_t nanoseconds = 0; ///< 0 to 999'999'999, also for negative times
};

void write_duration(json_writer& w, whole_time value);
void write_duration(json_writer& w, double seconds);
bool read_duration(json_reader& r, whole_time& value);
bool read_duration(json_reader& r, double& seconds);
void write_time_point(json_writer& w, whole_time since_1970);
bool read_time_point(json_reader& r, whole_time& since_1970);

inline constexpr std::string_view time_out_of_range = "a time out of range";

/// Converts a time to units of num/den seconds, rounded down. False if `count` would overflow.
bool count_units(whole_time value, std::int64_t num, std::int64_t den, std::int64_t& count) noexcept;
[[noreturn]] void throw_time_out_of_range();
/// Converts from units of num/den seconds. Throws if the number of seconds overflows.
whole_time whole_of(std::int64_t count, std::int64_t num, std::int64_t den);
whole_time whole_of(double seconds);
double seconds_of(whole_time value) noexcept;

/// The number of seconds of a floating-point duration. Throws if it is finite and overflows.
template <class Rep, class Period>
double seconds_of(const std::chrono::duration<Rep, Period>& value) {
    return require_finite(std::chrono::duration<double>(value).count(), detail::is_finite(value.count()),
                          time_out_of_range);
}

template <class Rep, class Period>
whole_time whole_of(const std::chrono::duration<Rep, Period>& value) {
    if constexpr (std::is_floating_point_v<Rep>) {
        return detail::whole_of(detail::seconds_of(value));
    } else {
        if (!detail::fits<std::int64_t>(value.count())) {
            throw_time_out_of_range();
        }
        return detail::whole_of(static_cast<std::int64_t>(value.count()), Period::num, Period::den);
    }
}

template <class Rep, class Period>
bool from_seconds(json_reader& r, double seconds, std::chrono::duration<Rep, Period>& value) {
    const std::chrono::duration<std::common_type_t<Rep, double>, Period> units{std::chrono::duration<double>(seconds)};
    value = std::chrono::duration<Rep, Period>(static_cast<Rep>(units.count()));
    return detail::is_finite(value.count()) || !detail::is_finite(seconds) || r.fail(time_out_of_range);
}

template <class Rep, class Period>
bool from_whole(json_reader& r, whole_time from, std::chrono::duration<Rep, Period>& value) {
    if constexpr (std::is_floating_point_v<Rep>) {
        return detail::from_seconds(r, detail::seconds_of(from), value);
    } else {
        std::int64_t count = 0;
        if (!count_units(from, Period::num, Period::den, count) || !detail::fits<Rep>(count)) {
            return r.fail(time_out_of_range);
        }
        value = std::chrono::duration<Rep, Period>(static_cast<Rep>(count));
        return true;
    }
}

} // namespace detail

template <class Rep, class Period>
struct converter<std::chrono::duration<Rep, Period>> {
    using duration = std::chrono::duration<Rep, Period>;
    static constexpr bool is_scalar = true;

    static void write(json_writer& w, const duration& value) {
        if constexpr (std::is_floating_point_v<Rep>) {
            detail::write_duration(w, detail::seconds_of(value));
        } else {
            detail::write_duration(w, detail::whole_of(value));
        }
    }
    static bool read(json_reader& r, duration& value) {
        if constexpr (std::is_floating_point_v<Rep>) {
            double seconds = 0;
            return detail::read_duration(r, seconds) && detail::from_seconds(r, seconds, value);
        } else {
            detail::whole_time whole;
            return detail::read_duration(r, whole) && detail::from_whole(r, whole, value);
        }
    }
};

template <class Duration>
struct converter<std::chrono::time_point<std::chrono::system_clock, Duration>> {
    using time_point = std::chrono::time_point<std::chrono::system_clock, Duration>;
    static constexpr bool is_scalar = true;

    static void write(json_writer& w, const time_point& value) {
        detail::write_time_point(w, detail::whole_of(value.time_since_epoch()));
    }
    static bool read(json_reader& r, time_point& value) {
        detail::whole_time whole;
        Duration since{};
        if (!detail::read_time_point(r, whole) || !detail::from_whole(r, whole, since)) {
            return false;
        }
        value = time_point{since};
        return true;
    }
};

} // namespace cles
