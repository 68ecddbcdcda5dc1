// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <string>
#include <string_view>

namespace tool {

/// Reads "500ms", "2s", "1.5min", "1h", or plain seconds: "2", "0.5". Whole milliseconds, and at most a day.
/// \throws usage_error that says how to write it
std::chrono::milliseconds parse_duration(std::string_view text);

/// The same, but at least a millisecond.
std::chrono::milliseconds parse_positive_duration(std::string_view text);

/// The same for an option that is about waits of the processor: a plain number is microseconds, and a second is the
/// most.
std::chrono::microseconds parse_wait(std::string_view option, std::string_view text);

/// A duration for people: "350 ms", "12 s", "3 h 20 min".
std::string to_text(std::chrono::milliseconds span);

} // namespace tool
