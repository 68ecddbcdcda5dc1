// SPDX-License-Identifier: BSL-1.0
#include <cles/printable.hpp>

#include "json/json_scan.hpp"

#include <cstddef>
#include <cstdint>

namespace cles {
namespace {

bool is_shown(std::uint32_t c) noexcept {
    const bool controls = c < 0x20 || (c >= 0x7f && c <= 0x9f);
    const bool turns =
        c == 0x061c || c == 0x200e || c == 0x200f || (c >= 0x202a && c <= 0x202e) || (c >= 0x2066 && c <= 0x2069);
    return !controls && !turns;
}

// Only characters of up to three bytes need escapes.
std::uint32_t code_point(std::string_view sequence) noexcept {
    const auto byte = [&sequence](std::size_t i) {
        return static_cast<std::uint32_t>(static_cast<unsigned char>(sequence[i]));
    };
    switch (sequence.size()) {
    case 1: return byte(0);
    case 2: return (byte(0) & 0x1fU) << 6U | (byte(1) & 0x3fU);
    case 3: return (byte(0) & 0x0fU) << 12U | (byte(1) & 0x3fU) << 6U | (byte(2) & 0x3fU);
    default: return 0x10000;
    }
}

void append_code_point(std::string& out, std::uint32_t c) {
    switch (c) {
    case '\n': out += "\\n"; return;
    case '\t': out += "\\t"; return;
    case '\r': out += "\\r"; return;
    default: break;
    }
    constexpr std::string_view hex = "0123456789abcdef";
    out += "\\u";
    for (const auto shift : {12U, 8U, 4U, 0U}) {
        out += hex[c >> shift & 0xfU];
    }
}

} // namespace

std::string printable(std::string_view text) {
    std::string out;
    out.reserve(text.size());
    for (std::size_t i = 0; i < text.size();) {
        const bool is_ascii = static_cast<unsigned char>(text[i]) < 0x80;
        const auto length = is_ascii ? std::size_t{1} : json_detail::utf8_sequence(text, i);
        if (length == 0) {
            out += "\xef\xbf\xbd";
            ++i;
            continue;
        }
        const auto character = text.substr(i, length);
        if (const auto c = code_point(character); is_shown(c)) {
            out += character;
        } else {
            append_code_point(out, c);
        }
        i += length;
    }
    return out;
}

} // namespace cles
