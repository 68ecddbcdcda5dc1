// SPDX-License-Identifier: BSL-1.0
#include "options/duration.hpp"

#include "output/errors.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

namespace tool {

using namespace std::chrono_literals;

namespace {

// Microseconds; nothing if it is not a duration.
std::optional<double> read_microseconds(std::string_view text, std::string_view plain) {
    static constexpr std::array<std::pair<std::string_view, double>, 5> units{
        {{"us", 1}, {"ms", 1e3}, {"s", 1e6}, {"min", 60e6}, {"h", 3600e6}}};
    double number = 0;
    const auto* end = text.data() + text.size();
    const auto [rest, code] = std::from_chars(text.data(), end, number, std::chars_format::fixed);
    const std::string_view written{rest, static_cast<std::size_t>(end - rest)};
    const auto* const unit =
        std::ranges::find(units, written.empty() ? plain : written, [](const auto& each) { return each.first; });
    if (code != std::errc{} || unit == units.end() || !std::isfinite(number) || std::signbit(number)) {
        return std::nullopt;
    }
    return number * unit->second;
}

} // namespace

std::chrono::milliseconds parse_duration(std::string_view text) {
    const auto us = read_microseconds(text, "s");
    if (!us) {
        throw usage_error("'" + std::string{text} +
                          "' is not a duration: write 500ms, 2s, 1min, 1h, or seconds as in 0.5");
    }
    if (*us > static_cast<double>(std::chrono::microseconds{24h}.count())) {
        throw usage_error("'" + std::string{text} + "' is longer than a day");
    }
    const auto ms = std::round(*us / 1e3);
    constexpr double inexact = 1e-4; // a day in microseconds has 11 digits, and a double 15
    if (std::abs(*us / 1e3 - ms) > inexact) {
        throw usage_error("'" + std::string{text} + "' is not a whole number of milliseconds");
    }
    return std::chrono::milliseconds{static_cast<std::int64_t>(ms)};
}

std::chrono::microseconds parse_wait(std::string_view option, std::string_view text) {
    const auto us = read_microseconds(text, "us");
    const auto given = std::string{option} + " '" + std::string{text} + "'";
    if (!us) {
        throw usage_error(given + " is not a duration: write 50us, 1ms, or microseconds as in 50");
    }
    if (*us > static_cast<double>(std::chrono::microseconds{1s}.count())) {
        throw usage_error(given + " is longer than a second");
    }
    return std::chrono::microseconds{std::llround(*us)};
}

std::chrono::milliseconds parse_positive_duration(std::string_view text) {
    const auto span = parse_duration(text);
    if (span < 1ms) {
        throw usage_error("'" + std::string{text} + "' is too short: at least 1ms");
    }
    return span;
}

std::string to_text(std::chrono::milliseconds span) {
    const auto ms = span.count();
    const auto two = [](auto large, const char* unit, auto small, const char* part) {
        return std::to_string(large) + unit + (small == 0 ? "" : " " + std::to_string(small) + part);
    };
    if (ms < 1000) {
        return std::to_string(ms) + " ms";
    }
    const auto s = ms / 1000;
    if (s < 60) {
        return std::to_string(s) + " s";
    }
    if (s < 3600) {
        return two(s / 60, " min", s % 60, " s");
    }
    if (s < 86400) {
        return two(s / 3600, " h", s / 60 % 60, " min");
    }
    return two(s / 86400, " d", s / 3600 % 24, " h");
}

} // namespace tool
