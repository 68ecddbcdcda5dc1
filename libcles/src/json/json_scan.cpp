// SPDX-License-Identifier: BSL-1.0
#include "json/json_scan.hpp"

#include <array>
#include <bit>
#include <charconv>
#include <cstdint>
#include <limits>
#include <string>

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

namespace {

void append_utf8(std::string& out, std::uint32_t c) {
    const auto put = [&](std::uint32_t byte) { out.push_back(static_cast<char>(byte)); };
    const unsigned more = c < 0x80 ? 0 : c < 0x800 ? 1 : c < 0x10000 ? 2 : 3; // bytes after the first
    put(more == 0 ? c : (0xFF00U >> (more + 1) & 0xFFU) | c >> (6 * more));
    for (auto i = more; i-- > 0;) {
        put(0x80U | (c >> (6 * i) & 0x3FU));
    }
}

bool hex4(std::string_view text, std::uint32_t& out) noexcept {
    if (text.size() < 4) {
        return false;
    }
    const auto* end = text.data() + 4;
    return std::from_chars(text.data(), end, out, 16).ptr == end;
}

std::string_view scan_escape(std::string_view text, std::size_t& at) noexcept {
    ++at;
    if (at >= text.size()) {
        return "a string without an end";
    }
    if (text[at] == 'u') {
        std::uint32_t unit = 0;
        if (!hex4(text.substr(at + 1), unit)) {
            return "\\u needs four hex digits";
        }
        at += 5;
        return {};
    }
    if (std::string_view{"\"\\/bfnrt"}.find(text[at]) == std::string_view::npos) {
        return "an unknown escape";
    }
    ++at;
    return {};
}

bool unescape_unit(std::string_view raw, std::size_t& at, std::string& out) {
    std::uint32_t unit = 0;
    hex4(raw.substr(at), unit);
    at += 4;
    if (unit >= 0xD800 && unit < 0xDC00) {
        std::uint32_t low = 0;
        if (raw.substr(at, 2) != "\\u" || !hex4(raw.substr(at + 2), low) || low < 0xDC00 || low > 0xDFFF) {
            return false;
        }
        at += 6;
        unit = 0x10000 + ((unit - 0xD800) << 10U) + (low - 0xDC00);
    } else if (unit >= 0xDC00 && unit < 0xE000) {
        return false;
    }
    append_utf8(out, unit);
    return true;
}

} // namespace

std::string_view scan_number(std::string_view text, std::size_t& at, bool& integral) noexcept {
    const auto* p = text.data() + at;
    const auto* const end = text.data() + text.size();
    const auto here = [&](char c) { return p != end && *p == c; };
    const auto skip_digits = [&] {
        const auto* const from = p;
        while (p != end && is_digit(*p)) {
            ++p;
        }
        return p != from;
    };
    const auto stop = [&](std::string_view wrong) {
        at = static_cast<std::size_t>(p - text.data());
        return wrong;
    };
    integral = true;
    p += here('-') ? 1 : 0;
    if (here('0')) {
        ++p;
        if (p != end && is_digit(*p)) {
            return stop("a number has no leading zeros");
        }
    } else if (!skip_digits()) {
        return stop("'-' without a digit");
    }
    if (here('.')) {
        integral = false;
        ++p;
        if (!skip_digits()) {
            return stop("'.' without a digit");
        }
    }
    if (here('e') || here('E')) {
        integral = false;
        ++p;
        p += here('+') || here('-') ? 1 : 0;
        if (!skip_digits()) {
            return stop("an exponent without a digit");
        }
    }
    return stop({});
}

namespace {

constexpr std::size_t max_digits = 19; // an integer of 64 bits holds them

constexpr auto powers_of_ten = [] {
    std::array<std::uint64_t, max_digits + 1> powers{};
    std::uint64_t power = 1;
    for (auto& each : powers) {
        each = power;
        power *= 10;
    }
    return powers;
}();

__extension__ using wide = unsigned __int128;

// The double nearest to digits / 10^decimals, of two that are equally near the even one. The quotient of both, shifted
// until their highest bit is set, has at least 63 bits; what is not in it decides only whether it is half way between
// two doubles, or more. \pre digits is not 0
double nearest_double(std::uint64_t digits, std::size_t decimals) noexcept {
    constexpr int kept = std::numeric_limits<double>::digits;
    constexpr int bias = std::numeric_limits<double>::max_exponent - 1;
    const auto power = powers_of_ten[decimals];
    const auto up = std::countl_zero(digits);
    const auto down = std::countl_zero(power);
    const auto divisor = power << static_cast<unsigned>(down);
    const auto dividend = static_cast<wide>(digits << static_cast<unsigned>(up)) << 63U;
    const auto quotient = static_cast<std::uint64_t>(dividend / divisor);
    const bool has_rest = static_cast<std::uint64_t>(dividend) != quotient * divisor;

    const auto excess = static_cast<unsigned>(64 - kept - std::countl_zero(quotient));
    const auto half = std::uint64_t{1} << (excess - 1);
    const auto beyond = quotient & (2 * half - 1);
    auto mantissa = quotient >> excess;
    if (beyond > half || (beyond == half && (has_rest || (mantissa & 1U) != 0))) {
        ++mantissa;
    }
    const auto exponent = static_cast<std::uint64_t>(std::int64_t{excess} + down - up - 63 + bias);
    return static_cast<double>(mantissa) * std::bit_cast<double>(exponent << static_cast<unsigned>(kept - 1));
}

} // namespace

bool read_decimal(std::string_view text, std::size_t& at, double& out) noexcept {
    constexpr std::uint64_t most_exact = std::uint64_t{1} << static_cast<unsigned>(std::numeric_limits<double>::digits);
    const auto* const begin = text.data() + at;
    const auto* const end = text.data() + text.size();
    const auto* p = begin;
    const bool negative = p != end && *p == '-';
    p += negative ? 1 : 0;
    std::uint64_t digits = 0;
    const auto* const whole = p;
    const auto take_digits = [&] {
        while (p != end && is_digit(*p)) {
            digits = digits * 10 + static_cast<std::uint64_t>(*p - '0');
            ++p;
        }
    };
    take_digits();
    auto count = static_cast<std::size_t>(p - whole);
    if (count == 0 || count > max_digits || (count > 1 && *whole == '0')) {
        return false;
    }
    std::size_t decimals = 0;
    if (p != end && *p == '.') {
        const auto* const fraction = ++p;
        take_digits();
        decimals = static_cast<std::size_t>(p - fraction);
        count += decimals;
        if (decimals == 0 || count > max_digits) {
            return false;
        }
    }
    if (p != end && (*p == 'e' || *p == 'E')) {
        return false;
    }
    const auto value = digits <= most_exact
                           ? static_cast<double>(static_cast<std::int64_t>(digits)) /
                                 static_cast<double>(static_cast<std::int64_t>(powers_of_ten[decimals]))
                           : nearest_double(digits, decimals);
    out = negative ? -value : value;
    at += static_cast<std::size_t>(p - begin);
    return true;
}

std::string_view scan_string(std::string_view text, std::size_t& at, std::string_view& raw, bool& escaped) noexcept {
    const auto start = ++at;
    escaped = false;
    for (;;) {
        at = plain_end(text, at);
        if (at >= text.size()) {
            return "a string without an end";
        }
        if (text[at] == '"') {
            raw = text.substr(start, at - start);
            ++at;
            return {};
        }
        if (text[at] == '\\') {
            escaped = true;
            if (const auto wrong = scan_escape(text, at); !wrong.empty()) {
                return wrong;
            }
        } else if (static_cast<unsigned char>(text[at]) < 0x20) {
            return "a control character in a string";
        } else if (const auto length = utf8_sequence(text, at); length != 0) {
            at += length;
        } else {
            return "invalid UTF-8 in a string";
        }
    }
}

bool unescape(std::string_view raw, std::string& out) {
    out.clear();
    for (std::size_t i = 0; i < raw.size();) {
        if (raw[i] != '\\') {
            out.push_back(raw[i++]);
            continue;
        }
        const auto c = raw[i + 1];
        i += 2;
        switch (c) {
        case 'b': out.push_back('\b'); break;
        case 'f': out.push_back('\f'); break;
        case 'n': out.push_back('\n'); break;
        case 'r': out.push_back('\r'); break;
        case 't': out.push_back('\t'); break;
        case 'u':
            if (!unescape_unit(raw, i, out)) {
                return false;
            }
            break;
        default: out.push_back(c);
        }
    }
    return true;
}

} // namespace cles::json_detail
