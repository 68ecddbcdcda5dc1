// SPDX-License-Identifier: BSL-1.0
#include "options/duration.hpp"

#include "output/errors.hpp"

#include <charconv>
#include <cmath>

namespace tool {

using namespace std::chrono_literals;

std::chrono::milliseconds parse_duration(std::string_view text) {
    double number = 0;
    const auto* end = text.data() + text.size();
    const auto [rest, code] = std::from_chars(text.data(), end, number, std::chars_format::fixed);
    const std::string_view unit{rest, static_cast<std::size_t>(end - rest)};
    const double scale = unit.empty() || unit == "s" ? 1000 : unit == "ms" ? 1 : unit == "min" ? 60'000 : 0;
    if (code != std::errc{} || scale == 0 || !std::isfinite(number) || std::signbit(number)) {
        throw usage_error("'" + std::string{text} + "' is not a duration: write 500ms, 2s, 1min, or seconds as in 0.5");
    }
    if (number * scale > static_cast<double>(std::chrono::milliseconds{24h}.count())) {
        throw usage_error("'" + std::string{text} + "' is longer than a day");
    }
    return std::chrono::milliseconds{std::llround(number * scale)};
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
