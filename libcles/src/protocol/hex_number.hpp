// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace cles::protocol {

/// Lower-case hex digits, all that `Number` has.
template <class Number>
std::optional<Number> parse_hex(std::string_view text) noexcept {
    Number value = 0;
    if (text.size() != 2 * sizeof(Number)) {
        return std::nullopt;
    }
    for (const auto c : text) {
        const bool digit = c >= '0' && c <= '9';
        if (!digit && (c < 'a' || c > 'f')) {
            return std::nullopt;
        }
        value = static_cast<Number>(value << 4U | static_cast<Number>(digit ? c - '0' : c - 'a' + 10));
    }
    return value;
}

template <class Number>
std::string hex_text(Number value) {
    constexpr std::string_view digits = "0123456789abcdef";
    std::string text(2 * sizeof(Number), '0');
    for (std::size_t i = text.size(); i-- > 0; value = static_cast<Number>(value >> 4U)) {
        text[i] = digits[value & 0xFU];
    }
    return text;
}

} // namespace cles::protocol
