// SPDX-License-Identifier: BSL-1.0
#include "output/log_line.hpp"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>

namespace tool {
namespace {

// "2026-08-01T12:00:00.000+02:00"
std::string local_time(std::chrono::system_clock::time_point at) {
    const auto since = std::chrono::floor<std::chrono::milliseconds>(at.time_since_epoch()).count();
    const auto seconds = static_cast<std::time_t>(since / 1000);
    std::tm parts{};
    ::localtime_r(&seconds, &parts);
    std::array<char, 32> day{};
    std::strftime(day.data(), day.size(), "%Y-%m-%dT%H:%M:%S", &parts);
    const auto zone = std::abs(parts.tm_gmtoff) / 60;
    std::array<char, 64> out{};
    std::snprintf(out.data(), out.size(), "%s.%03d%c%02ld:%02ld", day.data(), static_cast<int>(since % 1000),
                  parts.tm_gmtoff < 0 ? '-' : '+', zone / 60, zone % 60);
    return out.data();
}

std::string_view colour_of(cles::log_level level) {
    switch (level) {
    case cles::log_level::debug: return "\x1b[36m";
    case cles::log_level::info: return "\x1b[32m";
    case cles::log_level::warning: return "\x1b[1;33m";
    case cles::log_level::error: break;
    }
    return "\x1b[1;31m";
}

} // namespace

std::string_view name_of(cles::log_level level) {
    switch (level) {
    case cles::log_level::debug: return "debug";
    case cles::log_level::info: return "info";
    case cles::log_level::warning: return "warning";
    case cles::log_level::error: break;
    }
    return "error";
}

std::string log_line(std::chrono::system_clock::time_point at, cles::log_level level, std::string_view text,
                     bool coloured) {
    constexpr std::size_t widest = 7;
    std::string word{name_of(level)};
    word.resize(widest, ' ');
    if (coloured) {
        word.insert(0, colour_of(level)).append("\x1b[0m");
    }
    return local_time(at).append(" ").append(word).append(" ").append(text).append("\n");
}

std::string json_log_line(std::chrono::system_clock::time_point at, cles::log_level level, std::string_view members) {
    std::string out = R"({"time":")" + local_time(at);
    return out.append(R"(","level":")").append(name_of(level)).append("\",").append(members).append("}\n");
}

std::string dropped_text(std::uint64_t lines) {
    return "lines of this log that were dropped, because they could not be written: " + std::to_string(lines);
}

} // namespace tool
