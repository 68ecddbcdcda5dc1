// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <string>
#include <string_view>

namespace cles::test {

/// Why a text is not read as that type, without the position; "(read)" where it is.
template <class T>
std::string why(std::string_view text) {
    T value{};
    std::string message;
    return from_json(text, value, &message) ? "(read)" : message.substr(0, message.find(" (at byte"));
}

/// What is read from what is written.
template <class T>
T round_trip(const T& value) {
    return from_json<T>(to_json(value));
}

} // namespace cles::test
