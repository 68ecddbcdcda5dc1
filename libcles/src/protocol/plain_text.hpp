// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace cles::protocol {

/// Whether a character stands in a JSON string as it is, alone: printable ASCII, but no quotation mark or backslash.
constexpr bool is_plain(char c) noexcept {
    const auto byte = static_cast<unsigned char>(c);
    return byte >= 0x20 && byte < 0x80 && c != '"' && c != '\\';
}

/// Where a run of plain characters ends that begins at `at`. Long runs are passed eight characters at a time, since
/// texts of many kilobytes hold up what waits behind them.
inline std::size_t plain_end(std::string_view text, std::size_t at) noexcept {
    constexpr std::uint64_t each = 0x0101010101010101U;
    constexpr std::uint64_t tops = each * 0x80U;
    // A byte below `limit` has its top bit set in the result, as may others above the lowest of them.
    const auto below = [](std::uint64_t bytes, std::uint64_t limit) { return (bytes - each * limit) & ~bytes; };
    for (std::uint64_t word = 0; text.size() - at >= sizeof word; at += sizeof word) {
        std::memcpy(&word, text.data() + at, sizeof word);
        const auto special = below(word, 0x20) | below(word ^ (each * '"'), 1) | below(word ^ (each * '\\'), 1) | word;
        if ((special & tops) != 0) {
            break;
        }
    }
    while (at < text.size() && is_plain(text[at])) {
        ++at;
    }
    return at;
}

} // namespace cles::protocol
