// SPDX-License-Identifier: BSL-1.0
#include <cles/json_writer.hpp>

#include "protocol/plain_text.hpp"
#include "protocol/utf8.hpp"

#include <array>
#include <charconv>
#include <cmath>

namespace cles {
namespace {

template <class Number>
void append_number(std::string& out, Number n) {
    std::array<char, 32> digits;
    const auto* const end = std::to_chars(digits.data(), digits.data() + digits.size(), n).ptr;
    out.append(digits.data(), static_cast<std::size_t>(end - digits.data()));
}

constexpr std::int64_t power_of_ten(unsigned n) noexcept { return n == 0 ? 1 : 10 * power_of_ten(n - 1); }

constexpr double most_scaled = 1e15; // a double holds each integer below it, and more

// Writes it where so many decimals are enough.
template <unsigned Decimals>
bool append_decimal(std::string& out, double d) {
    constexpr auto scale = power_of_ten(Decimals);
    constexpr auto factor = static_cast<double>(scale);
    const auto magnitude = std::fabs(d);
    const auto scaled = magnitude * factor;
    if (!(scaled < most_scaled)) {
        return false;
    }
    // Where this rounds wrongly, what it gives does not read back as the same.
    const auto digits = static_cast<std::int64_t>(scaled + 0.5); // NOLINT(bugprone-incorrect-roundings)
    if (static_cast<double>(digits) / factor != magnitude) {
        return false;
    }
    std::array<char, 32> text;
    auto* p = text.data();
    if (std::signbit(d)) {
        *p++ = '-';
    }
    p = std::to_chars(p, text.data() + text.size(), digits / scale).ptr;
    if (auto rest = digits % scale; rest != 0) {
        *p = '.';
        for (auto n = Decimals; n != 0; --n, rest /= 10) {
            p[n] = static_cast<char>('0' + rest % 10);
        }
        p += Decimals;
        while (*p == '0') {
            --p;
        }
        ++p;
    }
    out.append(text.data(), static_cast<std::size_t>(p - text.data()));
    return true;
}

// Most measurements have few decimals, for which there is a way that is several times as quick as the general one. A
// decimal of at most 15 digits is the only such that reads back as the same double, so that one which does, with its
// zeros dropped, has the fewest digits there are.
bool append_short_decimal(std::string& out, double d) {
    return append_decimal<3>(out, d) || append_decimal<6>(out, d) || append_decimal<9>(out, d);
}

void append_escape(std::string& out, char c) {
    constexpr std::string_view hex = "0123456789abcdef";
    switch (c) {
    case '"': out += "\\\""; break;
    case '\\': out += "\\\\"; break;
    case '\b': out += "\\b"; break;
    case '\f': out += "\\f"; break;
    case '\n': out += "\\n"; break;
    case '\r': out += "\\r"; break;
    case '\t': out += "\\t"; break;
    default:
        out += "\\u00";
        out += hex[static_cast<unsigned char>(c) >> 4U];
        out += hex[static_cast<unsigned char>(c) & 0xFU];
    }
}

void append_string(std::string& out, std::string_view text) {
    out.push_back('"');
    for (std::size_t i = 0; i < text.size();) {
        const auto run = protocol::plain_end(text, i);
        out.append(text.substr(i, run - i));
        i = run;
        if (i == text.size()) {
            break;
        }
        if (static_cast<unsigned char>(text[i]) < 0x80) {
            append_escape(out, text[i++]);
        } else if (const auto length = protocol::utf8_sequence(text, i); length != 0) {
            out.append(text.substr(i, length));
            i += length;
        } else {
            out += "\xEF\xBF\xBD";
            ++i;
        }
    }
    out.push_back('"');
}

} // namespace

void json_writer::open(char bracket) {
    separate();
    out_.push_back(bracket);
}

void json_writer::key(std::string_view name) {
    separate();
    append_string(out_, name);
    out_.push_back(':');
}

void json_writer::plain_key(std::string_view name) {
    separate();
    out_.push_back('"');
    out_.append(name);
    out_.append("\":", 2);
}

void json_writer::plain_key(const prepared_key& name) {
    const bool is_first = out_.ends_with('{');
    out_.append(name.text().substr(is_first ? 1 : 0));
}

void json_writer::null() { raw("null"); }

void json_writer::value(bool b) { raw(b ? "true" : "false"); }

void json_writer::value(double d) {
    if (!std::isfinite(d)) {
        null();
        return;
    }
    separate();
    if (!append_short_decimal(out_, d)) {
        append_number(out_, d);
    }
}

void json_writer::value(std::int64_t i) {
    separate();
    append_number(out_, i);
}

void json_writer::value(std::uint64_t u) {
    separate();
    append_number(out_, u);
}

void json_writer::value(std::string_view text) {
    separate();
    append_string(out_, text);
}

void json_writer::raw(std::string_view json) {
    separate();
    out_.append(json);
}

} // namespace cles
