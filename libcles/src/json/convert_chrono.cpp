// SPDX-License-Identifier: BSL-1.0
#include <cles/convert_chrono.hpp>

#include "json/json_scan.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <string_view>

namespace cles::detail {
namespace {

__extension__ using wide = __int128;

constexpr std::int64_t second = 1'000'000'000; // in nanoseconds
constexpr std::int64_t minute = 60;            // in seconds
constexpr std::int64_t hour = 60 * minute;
constexpr std::int64_t day = 24 * hour;
constexpr std::int64_t week = 7 * day;

constexpr double max_seconds = 9e18; // that fit into 64 bits

wide floor_divide(wide a, wide b) { return a / b - static_cast<wide>(a % b != 0 && (a < 0) != (b < 0)); }

bool narrow(wide value, std::int64_t& out) {
    out = static_cast<std::int64_t>(value);
    return out == value;
}

bool to_whole(wide nanoseconds, whole_time& value) {
    const auto seconds = floor_divide(nanoseconds, second);
    if (!narrow(seconds, value.seconds)) {
        return false;
    }
    value.nanoseconds = static_cast<std::int64_t>(nanoseconds - seconds * second);
    return true;
}

/// Reads a text from its start.
class scanner {
  public:
    explicit scanner(std::string_view text) noexcept : text_(text) {}

    [[nodiscard]] bool at_end() const noexcept { return text_.empty(); }
    bool take(char c) noexcept {
        if (text_.empty() || text_.front() != c) {
            return false;
        }
        text_.remove_prefix(1);
        return true;
    }
    bool take_any(std::string_view chars, char* which = nullptr) noexcept {
        if (text_.empty() || chars.find(text_.front()) == std::string_view::npos) {
            return false;
        }
        if (which != nullptr) {
            *which = text_.front();
        }
        text_.remove_prefix(1);
        return true;
    }
    /// A number of exactly `count` digits, and at most `most`.
    bool digits(std::size_t count, unsigned most, unsigned& out) noexcept {
        if (text_.size() < count) {
            return false;
        }
        const auto* const end = text_.data() + count;
        const bool all = std::from_chars(text_.data(), end, out).ptr == end;
        text_.remove_prefix(count);
        return all && out <= most;
    }
    /// A decimal without sign or exponent, in billionths; digits after the ninth are dropped. False if there is none,
    /// or it is too large.
    bool decimal(wide& billionths) noexcept {
        constexpr std::size_t max_digits = 19;
        std::uint64_t whole = 0;
        const auto [end, code] = std::from_chars(text_.data(), text_.data() + text_.size(), whole);
        const auto count = static_cast<std::size_t>(end - text_.data());
        text_.remove_prefix(count);
        if (code != std::errc{} || count > max_digits) {
            return false;
        }
        billionths = static_cast<wide>(whole) * second;
        billionths += fraction();
        return true;
    }
    /// The fraction after a point or a comma, in billionths; 0 if there is neither.
    std::int64_t fraction() noexcept {
        std::int64_t billionths = 0;
        if (text_.size() > 1 && (text_.front() == '.' || text_.front() == ',') && json_detail::is_digit(text_[1])) {
            text_.remove_prefix(1);
            for (auto unit = second / 10; !text_.empty() && json_detail::is_digit(text_.front()); unit /= 10) {
                billionths += (text_.front() - '0') * unit;
                text_.remove_prefix(1);
            }
        }
        return billionths;
    }

  private:
    std::string_view text_;
};

std::int64_t unit_of(char letter, bool in_time) noexcept {
    switch (letter) {
    case 'W': return in_time ? 0 : week;
    case 'D': return in_time ? 0 : day;
    case 'H': return in_time ? hour : 0;
    case 'M': return in_time ? minute : 0;
    case 'S': return in_time ? 1 : 0;
    default: return 0;
    }
}

constexpr std::string_view duration_expected = "expected a duration as \"PT1.5S\" or a number of seconds";
constexpr std::string_view time_expected =
    "expected a time as \"2026-11-23T07:43:14Z\" or a number of seconds since 1970";

// Returns what is wrong; empty if nothing is.
std::string_view parse_duration(std::string_view text, whole_time& value) {
    scanner from{text};
    bool negative = from.take('-');
    if (!negative) {
        from.take('+');
    }
    if (!from.take('P')) {
        return duration_expected;
    }
    wide total = 0;
    bool in_time = false;
    bool any = false;
    while (!from.at_end()) {
        if (!in_time && from.take('T')) {
            in_time = true;
            any = false; // at least one part must follow
            continue;
        }
        const bool minus = from.take('-'); // as Java writes it
        wide number = 0;
        char letter = 0;
        if (!from.decimal(number) || !from.take_any("YMWDHS", &letter)) {
            return duration_expected;
        }
        if (letter == 'Y' || (letter == 'M' && !in_time)) {
            return "expected a duration without years and months, which have no fixed length";
        }
        const auto unit = unit_of(letter, in_time);
        if (unit == 0) {
            return duration_expected;
        }
        if (__builtin_add_overflow(total, (minus ? -number : number) * unit, &total)) {
            return time_out_of_range;
        }
        any = true;
    }
    if (!any) {
        return duration_expected;
    }
    if (negative && __builtin_sub_overflow(wide{0}, total, &total)) {
        return time_out_of_range;
    }
    return to_whole(total, value) ? std::string_view{} : time_out_of_range;
}

bool parse_zone(scanner& from, std::int64_t& ahead) {
    if (from.take_any("Zz")) {
        ahead = 0;
        return true;
    }
    char sign = 0;
    unsigned hours = 0;
    unsigned minutes = 0;
    if (!from.take_any("+-", &sign) || !from.digits(2, 23, hours)) {
        return false;
    }
    if (!from.at_end()) {
        from.take(':');
        if (!from.digits(2, 59, minutes)) {
            return false;
        }
    }
    ahead = (hours * hour + minutes * minute) * (sign == '-' ? -1 : 1);
    return true;
}

std::string_view parse_time_point(std::string_view text, whole_time& value) {
    namespace chrono = std::chrono;
    scanner from{text};
    unsigned year = 0;
    unsigned month = 0;
    unsigned in_month = 0;
    unsigned hours = 0;
    unsigned minutes = 0;
    unsigned seconds = 0;
    constexpr unsigned leap = 60; // the next second, as POSIX counts
    if (!from.digits(4, 9999, year) || !from.take('-') || !from.digits(2, 12, month) || !from.take('-') ||
        !from.digits(2, 31, in_month) || !from.take_any("Tt ") || !from.digits(2, 23, hours) || !from.take(':') ||
        !from.digits(2, 59, minutes) || !from.take(':') || !from.digits(2, leap, seconds)) {
        return time_expected;
    }
    const auto nanoseconds = from.fraction();
    std::int64_t ahead = 0;
    if (!parse_zone(from, ahead)) {
        return "expected a time zone after the time, Z or such as +01:00";
    }
    const chrono::year_month_day date{chrono::year{static_cast<int>(year)}, chrono::month{month},
                                      chrono::day{in_month}};
    if (!from.at_end() || !date.ok()) {
        return time_expected;
    }
    const std::int64_t days = chrono::sys_days{date}.time_since_epoch().count();
    value = {days * day + hours * hour + minutes * minute + seconds - ahead, nanoseconds};
    return {};
}

// A number of seconds, exact unless it has an exponent.
bool read_seconds(json_reader& r, whole_time& value) {
    std::string_view raw;
    if (!r.read_raw(raw)) {
        return false;
    }
    auto digits = raw;
    const bool negative = digits.starts_with('-');
    digits.remove_prefix(negative ? 1 : 0);
    scanner from{digits};
    wide billionths = 0;
    if (!from.decimal(billionths) || !from.at_end()) {
        double seconds = 0;
        json_reader number{raw};
        if (!number.read(seconds) || !(std::fabs(seconds) < max_seconds)) {
            return r.fail(time_out_of_range);
        }
        value = whole_of(seconds);
        return true;
    }
    return to_whole(negative ? -billionths : billionths, value) || r.fail(time_out_of_range);
}

void append_fraction(std::string& out, std::int64_t nanoseconds) {
    if (nanoseconds == 0) {
        return;
    }
    auto digits = std::to_string(second + nanoseconds); // with a 1 before the zeros
    digits.front() = '.';
    digits.erase(digits.find_last_not_of('0') + 1);
    out.append(digits);
}

// A number of seconds, or a text that `parse` reads, which returns what is wrong.
bool read_time(json_reader& r, whole_time& value, std::string_view (*parse)(std::string_view, whole_time&),
               std::string_view expected) {
    if (r.peek() == json_reader::kind::number) {
        return read_seconds(r, value);
    }
    std::string_view text;
    if (r.peek() != json_reader::kind::string || !r.read(text)) {
        return r.fail(expected);
    }
    const auto wrong = parse(text, value);
    return wrong.empty() || r.fail(wrong);
}

} // namespace

void throw_time_out_of_range() { throw error(errc::conversion, std::string{time_out_of_range}); }

whole_time whole_of(double seconds) {
    if (!(std::fabs(seconds) < max_seconds)) {
        throw_time_out_of_range();
    }
    const auto down = std::floor(seconds);
    const auto nanoseconds = static_cast<std::int64_t>((seconds - down) * static_cast<double>(second));
    return {static_cast<std::int64_t>(down), std::min(nanoseconds, second - 1)};
}

double seconds_of(whole_time value) noexcept {
    return static_cast<double>(value.seconds) + static_cast<double>(value.nanoseconds) / static_cast<double>(second);
}

bool count_units(whole_time value, std::int64_t num, std::int64_t den, std::int64_t& count) noexcept {
    wide nanoseconds = static_cast<wide>(value.seconds) * second + value.nanoseconds;
    if (__builtin_mul_overflow(nanoseconds, static_cast<wide>(den), &nanoseconds)) {
        return false;
    }
    const auto units = floor_divide(nanoseconds, static_cast<wide>(num) * second);
    return narrow(units, count);
}

whole_time whole_of(std::int64_t count, std::int64_t num, std::int64_t den) {
    const auto units = static_cast<wide>(count) * num;
    const auto seconds = floor_divide(units, den);
    whole_time value;
    if (!narrow(seconds, value.seconds)) {
        throw_time_out_of_range();
    }
    value.nanoseconds = static_cast<std::int64_t>((units - seconds * den) * second / den);
    return value;
}

void write_duration(json_writer& w, whole_time value) {
    const bool negative = value.seconds < 0;
    if (negative && value.nanoseconds != 0) { // -1.5 is -2 and 0.5
        ++value.seconds;
        value.nanoseconds = second - value.nanoseconds;
    }
    const auto seconds = static_cast<std::uint64_t>(value.seconds);
    std::string text{negative ? "-PT" : "PT"};
    text.append(std::to_string(negative ? 0 - seconds : seconds));
    append_fraction(text, value.nanoseconds);
    w.value(std::string_view{text.append("S")});
}

void write_duration(json_writer& w, double seconds) {
    if (!std::isfinite(seconds)) {
        w.null();
        return;
    }
    std::array<char, 400> digits; // the longest has 309 before the point, or more than 324 after it
    const auto magnitude = std::fabs(seconds);
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), magnitude, std::chars_format::fixed);
    std::string text{std::signbit(seconds) ? "-PT" : "PT"};
    text.append(digits.data(), static_cast<std::size_t>(end.ptr - digits.data()));
    w.value(std::string_view{text.append("S")});
}

bool read_duration(json_reader& r, whole_time& value) { return read_time(r, value, parse_duration, duration_expected); }

bool read_duration(json_reader& r, double& seconds) {
    if (r.peek() == json_reader::kind::number) {
        return r.read(seconds);
    }
    if (r.peek() == json_reader::kind::null) { // the written form of a number that is not finite
        seconds = std::numeric_limits<double>::quiet_NaN();
        return r.read_null();
    }
    std::string_view text;
    if (r.peek() != json_reader::kind::string || !r.read(text)) {
        return r.fail(duration_expected);
    }
    // With seconds alone, every digit counts.
    auto digits = text;
    const bool negative = digits.starts_with('-');
    digits.remove_prefix(negative ? 1 : 0);
    if (digits.starts_with("PT") && digits.ends_with('S') && digits.find_first_of("HM-") == std::string_view::npos) {
        digits = digits.substr(2, digits.size() - 3);
        double number = 0;
        if (digits.empty() || !json_detail::is_digit(digits.front()) || !json_detail::is_digit(digits.back())) {
            return r.fail(duration_expected);
        }
        const auto* const end = digits.data() + digits.size();
        const auto [ptr, code] = std::from_chars(digits.data(), end, number, std::chars_format::fixed);
        if (code == std::errc{} && ptr == end) {
            seconds = negative ? -number : number;
            return true;
        }
    }
    whole_time whole;
    const auto wrong = parse_duration(text, whole);
    if (!wrong.empty()) {
        return r.fail(wrong);
    }
    seconds = seconds_of(whole);
    return true;
}

void write_time_point(json_writer& w, whole_time since_1970) {
    namespace chrono = std::chrono;
    constexpr std::int64_t first = -62'167'219'200; // year 0
    constexpr std::int64_t past = 253'402'300'800;  // year 10000
    if (since_1970.seconds < first || since_1970.seconds >= past) {
        throw_time_out_of_range();
    }
    const auto when = chrono::sys_seconds{chrono::seconds{since_1970.seconds}};
    const auto midnight = chrono::floor<chrono::days>(when);
    const chrono::year_month_day date{midnight};
    const chrono::hh_mm_ss in_day{when - midnight};
    std::array<char, 80> digits;
    std::snprintf(digits.data(), digits.size(), "%04d-%02u-%02uT%02d:%02d:%02d", static_cast<int>(date.year()),
                  static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                  static_cast<int>(in_day.hours().count()), static_cast<int>(in_day.minutes().count()),
                  static_cast<int>(in_day.seconds().count()));
    std::string text{digits.data()};
    append_fraction(text, since_1970.nanoseconds);
    w.value(std::string_view{text.append("Z")});
}

bool read_time_point(json_reader& r, whole_time& since_1970) {
    return read_time(r, since_1970, parse_time_point, time_expected);
}

} // namespace cles::detail
