// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

namespace tool {

/// "debug", "info", "warning" or "error"
std::string_view name_of(cles::log_level level);

/// A line of a log for people, with LF: "2026-08-01T12:00:00.000+02:00 info    TEXT".
/// \param text printable
std::string log_line(std::chrono::system_clock::time_point at, cles::log_level level, std::string_view text,
                     bool coloured);

/// The same as a JSON object: {"time":"2026-08-01T12:00:00.000+02:00","level":"info",MEMBERS}.
/// \param members without braces
std::string json_log_line(std::chrono::system_clock::time_point at, cles::log_level level, std::string_view members);

/// What a log says when lines were dropped.
std::string dropped_text(std::uint64_t lines);

} // namespace tool
