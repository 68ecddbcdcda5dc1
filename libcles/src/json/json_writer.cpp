// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/json_writer.hpp>

#include "json/json_scan.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace cles {
namespace {

constexpr auto two_digits = [] {
    std::array<char, 200> text{};
    for (std::size_t i = 0; i < text.size(); i += 2) {
        text[i] = static_cast<char>('0' + i / 20);
        text[i + 1] = static_cast<char>('0' + i / 2 % 10);
    }
    return text;
}();

// Most measurements have few decimals, which this writes several times faster than the general algorithm. A decimal of
// at most 15 digits is the only such decimal that reads back as the same double, so one that does, without trailing
// zeros, is the shortest.
bool append_short_decimal(std::string& out, double d) {
    struct scale {
        double factor;
        unsigned decimals;
    };
    constexpr std::array scales{scale{1e3, 3}, scale{1e6, 6}, scale{1e9, 9}};
    constexpr double most = 1e15;
    constexpr double half = 0.5; // added, it rounds to the nearest integer
    const auto magnitude = std::fabs(d);
    for (const auto& s : scales) {
        const auto scaled = magnitude * s.factor;
        if (!(scaled < most)) {
            return false;
        }
        auto digits = static_cast<std::uint64_t>(static_cast<std::int64_t>(scaled + half));
        if (static_cast<double>(static_cast<std::int64_t>(digits)) / s.factor != magnitude) {
            continue;
        }
        auto decimals = s.decimals;
        while (decimals != 0 && digits % 10 == 0) {
            digits /= 10;
            --decimals;
        }
        std::array<char, 32> text;
        auto* const last = text.data() + text.size();
        auto* p = last;
        const auto put_two = [&p, &digits] {
            p -= 2;
            std::memcpy(p, two_digits.data() + 2 * (digits % 100), 2);
            digits /= 100;
        };
        const auto put_one = [&p, &digits] {
            *--p = static_cast<char>('0' + digits % 10);
            digits /= 10;
        };
        if (decimals != 0) {
            for (; decimals >= 2; decimals -= 2) {
                put_two();
            }
            if (decimals != 0) {
                put_one();
            }
            *--p = '.';
        }
        while (digits >= 10) {
            put_two();
        }
        if (digits != 0 || p == last || *p == '.') {
            put_one();
        }
        if (std::signbit(d)) {
            *--p = '-';
        }
        out.append(p, static_cast<std::size_t>(last - p));
        return true;
    }
    return false;
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

} // namespace

void json_writer::open(char bracket) {
    if (depth_ == max_depth_) {
        throw error(errc::conversion, "nested deeper than " + std::to_string(max_depth_) + " levels");
    }
    ++depth_;
    separate();
    out_.push_back(bracket);
}

void json_writer::append_string(std::string_view text) {
    out_.push_back('"');
    for (std::size_t i = 0; i < text.size();) {
        const auto run = json_detail::plain_end(text, i);
        out_.append(text.substr(i, run - i));
        i = run;
        if (i == text.size()) {
            break;
        }
        if (static_cast<unsigned char>(text[i]) < 0x80) {
            append_escape(out_, text[i++]);
        } else if (const auto length = json_detail::utf8_sequence(text, i); length != 0) {
            out_.append(text.substr(i, length));
            i += length;
        } else {
            broken_ = std::min(broken_, out_.size() - start_);
            out_ += "\xEF\xBF\xBD";
            ++i;
        }
    }
    out_.push_back('"');
}

void json_writer::key(std::string_view name) {
    separate();
    append_string(name);
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

void json_writer::null() { checked("null"); }

void json_writer::value(bool b) { checked(b ? "true" : "false"); }

void json_writer::value(double d) {
    if (!std::isfinite(d)) {
        null();
        return;
    }
    separate();
    if (!append_short_decimal(out_, d)) {
        json_detail::append_number(out_, d);
    }
}

void json_writer::value(float f) {
    if (!std::isfinite(f)) {
        null();
        return;
    }
    separate();
    json_detail::append_number(out_, f);
}

void json_writer::value(std::int64_t i) {
    separate();
    json_detail::append_number(out_, i);
}

void json_writer::value(std::uint64_t u) {
    separate();
    json_detail::append_number(out_, u);
}

void json_writer::value(std::string_view text) {
    separate();
    append_string(text);
}

void json_writer::raw(std::string_view json) {
    has_raw_ = true;
    checked(json);
}

void json_writer::checked(std::string_view json) {
    separate();
    out_.append(json);
}

void json_writer::enclose(std::string_view before, std::string_view after) {
    has_raw_ = true;
    out_.insert(start_, before);
    out_.append(after);
    broken_ += broken_ == npos ? 0 : before.size();
}

} // namespace cles
