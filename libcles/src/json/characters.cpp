// SPDX-License-Identifier: BSL-1.0
#include "json/characters.hpp"

#include <cstdint>

namespace cles::json_detail {

std::size_t utf8_sequence(std::string_view text, std::size_t at) noexcept {
    const auto byte = [&](std::size_t i) -> std::uint8_t {
        return i < text.size() ? static_cast<std::uint8_t>(text[i]) : std::uint8_t{0};
    };
    const auto within = [](std::uint8_t b, std::uint8_t low, std::uint8_t high) { return b >= low && b <= high; };
    const auto lead = byte(at);
    if (at >= text.size()) {
        return 0;
    }
    if (lead < 0x80) {
        return 1;
    }
    if (within(lead, 0xC2, 0xDF)) {
        return within(byte(at + 1), 0x80, 0xBF) ? 2 : 0;
    }
    if (within(lead, 0xE0, 0xEF)) {
        const std::uint8_t low = lead == 0xE0 ? 0xA0 : 0x80;  // no overlong forms
        const std::uint8_t high = lead == 0xED ? 0x9F : 0xBF; // no surrogates
        return within(byte(at + 1), low, high) && within(byte(at + 2), 0x80, 0xBF) ? 3 : 0;
    }
    if (within(lead, 0xF0, 0xF4)) {
        const std::uint8_t low = lead == 0xF0 ? 0x90 : 0x80;
        const std::uint8_t high = lead == 0xF4 ? 0x8F : 0xBF; // nothing past U+10FFFF
        return within(byte(at + 1), low, high) && within(byte(at + 2), 0x80, 0xBF) && within(byte(at + 3), 0x80, 0xBF)
                   ? 4
                   : 0;
    }
    return 0;
}

bool is_utf8(std::string_view text) noexcept {
    for (std::size_t i = 0; i < text.size();) {
        const auto length = utf8_sequence(text, i);
        if (length == 0) {
            return false;
        }
        i += length;
    }
    return true;
}

} // namespace cles::json_detail
