// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <system_error>

/// The characters and tokens of JSON (RFC 8259, sections 6 and 7). The scanners start at `at` and leave it after the
/// token, or return what is wrong there; an empty result is success.

namespace cles::json_detail {

/// Whether a JSON string may contain the character as it is, on its own: printable ASCII except quotation mark and
/// backslash.
constexpr bool is_plain(char c) noexcept {
    const auto byte = static_cast<unsigned char>(c);
    return byte >= 0x20 && byte < 0x80 && c != '"' && c != '\\';
}

/// The end of the run of plain characters that starts at `at`. Long runs are skipped eight characters at a time, since
/// texts of many kilobytes delay what waits behind them.
inline std::size_t plain_end(std::string_view text, std::size_t at) noexcept {
    constexpr std::uint64_t each = 0x0101010101010101U;
    constexpr std::uint64_t tops = each * 0x80U;
    // A byte below `limit` has its top bit set in the result, as may bytes above the lowest such byte.
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

/// As in the grammars of JSON and of the protocol: ASCII, whatever the locale.
constexpr bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }

constexpr bool is_letter(char c) noexcept { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

/// The length of the well-formed UTF-8 sequence (Unicode 15, table 3-7) that starts at `at`, or 0.
std::size_t utf8_sequence(std::string_view text, std::size_t at) noexcept;

bool is_utf8(std::string_view text) noexcept;

template <class Number>
void append_number(std::string& out, Number n) {
    std::array<char, 32> digits;
    const auto* const end = std::to_chars(digits.data(), digits.data() + digits.size(), n).ptr;
    out.append(digits.data(), static_cast<std::size_t>(end - digits.data()));
}

/// Reads a number that is the whole text, as `std::from_chars` does.
template <class Number>
bool read_number(std::string_view text, Number& n) noexcept {
    const auto* const end = text.data() + text.size();
    const auto [rest, code] = std::from_chars(text.data(), end, n);
    return code == std::errc{} && rest == end;
}

std::string_view scan_number(std::string_view text, std::size_t& at, bool& integral) noexcept;

/// Reads a number of the usual form, up to 19 digits and no exponent, exactly and quickly. False for any other, valid
/// or not; then `at` stays. Such a number is a quotient of two integers. If a double holds both exactly, which is so up
/// to 15 digits, one division rounds it correctly (Clinger 1990, "How to read floating point numbers accurately");
/// otherwise one of integers does, with its rest.
bool read_decimal(std::string_view text, std::size_t& at, double& out) noexcept;

/// `at` is the opening quote. `raw` is set to the text between the quotes, `escaped` to whether it has escapes.
std::string_view scan_string(std::string_view text, std::size_t& at, std::string_view& raw, bool& escaped) noexcept;

/// Decodes a scanned string. False if an escape is half of a surrogate pair.
bool unescape(std::string_view raw, std::string& out);

} // namespace cles::json_detail
