// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <string>
#include <string_view>

namespace cles::test {

/// Why a text cannot be read as that type, without the position; "(read)" if it can.
template <class T>
std::string why(std::string_view text) {
    T value{};
    std::string message;
    return from_json(text, value, &message) ? "(read)" : message.substr(0, message.find(" (at byte"));
}

/// Writes a value and reads it back.
template <class T>
T round_trip(const T& value) {
    return from_json<T>(to_json(value));
}

} // namespace cles::test
