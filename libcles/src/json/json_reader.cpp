// SPDX-License-Identifier: BSL-1.0
#include <cles/json_reader.hpp>
#include <cles/printable.hpp>

#include "json/json_scan.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <system_error>
#include <utility>

namespace cles {
namespace {

std::string_view name_of(json_reader::kind k) noexcept {
    constexpr std::array<std::string_view, 7> names{
        "an object", "an array", "a string", "a number", "true or false", "null", "something that is not JSON"};
    return names[static_cast<std::size_t>(k)];
}

std::string_view comma_or(char close) noexcept { return close == '}' ? "',' or '}'" : "',' or ']'"; }

} // namespace

bool json_reader::fail(std::string_view message) {
    if (ok()) {
        message_ = message;
        failed_at_ = at_;
    }
    return false;
}

bool json_reader::fail_as(const json_reader& part) {
    if (ok()) {
        message_ = part.message_;
        path_ = part.path_;
        failed_at_ = static_cast<std::size_t>(part.text_.data() - text_.data()) + part.failed_at_;
    }
    return false;
}

bool json_reader::expected(std::string_view what) {
    if (!ok()) {
        return false;
    }
    std::string text{"expected "};
    text.append(what);
    if (at_ >= text_.size()) {
        text.append(", but the text ends");
    } else {
        text.append(", got ").append(name_of(peek()));
    }
    return fail(text);
}

// A word that begins as `null`, `true` or `false` do is another one.
bool json_reader::expected_word(std::string_view word) {
    constexpr std::size_t longest = 16;
    const auto rest = text_.substr(at_, longest);
    std::size_t length = 0;
    while (length < rest.size() && (json_detail::is_letter(rest[length]) || json_detail::is_digit(rest[length]))) {
        ++length;
    }
    return fail("expected " + std::string{word} + ", got '" + std::string{rest.substr(0, length)} + "'");
}

void json_reader::inside_member(std::string_view name) {
    if (!path_.empty() && path_.front() != '[') {
        path_.insert(0, ".");
    }
    path_.insert(0, name);
}

void json_reader::inside_element(std::size_t index) { inside_member("[" + std::to_string(index) + "]"); }

std::string json_reader::error() const {
    if (ok()) {
        return {};
    }
    std::string text;
    if (!path_.empty()) {
        text.append(path_).append(": ");
    }
    text.append(message_).append(" (at byte ").append(std::to_string(failed_at_)).append(")");
    return printable(text); // the path has keys from the text
}

json_reader::kind json_reader::peek() noexcept {
    switch (const auto c = look()) {
    case '{': return kind::object;
    case '[': return kind::array;
    case '"': return kind::string;
    case 't':
    case 'f': return kind::boolean;
    case 'n': return kind::null;
    default: return c == '-' || json_detail::is_digit(c) ? kind::number : kind::invalid;
    }
}

bool json_reader::require(kind wanted) { return ok() && (peek() == wanted || expected(name_of(wanted))); }

bool json_reader::fail_too_deep() { return fail("nested deeper than " + std::to_string(max_depth_) + " levels"); }

bool json_reader::enter() {
    if (depth_ == max_depth_) {
        return fail_too_deep();
    }
    ++depth_;
    ++at_;
    first_ = true;
    return true;
}

bool json_reader::begin_object() { return require(kind::object) && enter(); }

bool json_reader::begin_array() { return require(kind::array) && enter(); }

// Moves to the next member or element. False at the end, which it consumes, and on failure.
bool json_reader::next(char close) {
    if (!ok()) {
        return false;
    }
    const auto c = look();
    const bool is_first = std::exchange(first_, false);
    if (c == close) {
        ++at_;
        --depth_;
        return false;
    }
    if (!is_first) {
        if (c != ',') {
            return expected(comma_or(close));
        }
        ++at_;
    }
    return true;
}

bool json_reader::next_key(std::string_view& key) { return next('}') && scan_key(key, scratch_); }

// A member's name, and the colon after it.
bool json_reader::scan_key(std::string_view& out, std::string& decoded) {
    if (look() != '"') {
        return expected("a member's name");
    }
    if (!scan_string(out, decoded)) {
        return false;
    }
    if (look() != ':') {
        return expected("':'");
    }
    ++at_;
    return true;
}

bool json_reader::next_key_is(std::string_view name) noexcept {
    if (!ok()) {
        return false;
    }
    auto at = at_;
    if (!first_) {
        if (at >= text_.size() || text_[at] != ',') {
            return false;
        }
        ++at;
    }
    const auto rest = text_.substr(at);
    const auto size = name.size();
    if (rest.size() < size + 3 || rest[0] != '"' || rest[size + 1] != '"' || rest[size + 2] != ':' ||
        rest.substr(1, size) != name) {
        return false;
    }
    at_ = at + size + 3;
    first_ = false;
    return true;
}

bool json_reader::next_key_is(const prepared_key& name) noexcept {
    const auto wanted = name.text().substr(first_ ? 1 : 0); // without the comma
    if (!ok() || !text_.substr(at_).starts_with(wanted)) {
        return false;
    }
    at_ += wanted.size();
    first_ = false;
    return true;
}

bool json_reader::next_element() { return next(']'); }

bool json_reader::literal(std::string_view word) {
    if (text_.substr(at_, word.size()) != word) {
        return expected_word(word);
    }
    at_ += word.size();
    return true;
}

bool json_reader::read_null() { return require(kind::null) && literal("null"); }

bool json_reader::read(bool& out) {
    if (!require(kind::boolean)) {
        return false;
    }
    out = text_[at_] == 't';
    return literal(out ? "true" : "false");
}

bool json_reader::scan_number(std::string_view& out, bool& integral) {
    const auto start = at_;
    if (const auto wrong = json_detail::scan_number(text_, at_, integral); !wrong.empty()) {
        return fail(wrong);
    }
    out = text_.substr(start, at_ - start);
    return true;
}

bool json_reader::read(double& out) {
    skip_space();
    if (ok() && json_detail::read_decimal(text_, at_, out)) {
        return true;
    }
    std::string_view digits;
    bool integral = false;
    if (!require(kind::number) || !scan_number(digits, integral)) {
        return false;
    }
    if (std::from_chars(digits.data(), digits.data() + digits.size(), out).ec != std::errc{}) {
        return fail("a number out of the range of a double");
    }
    return true;
}

bool json_reader::read(float& out) {
    std::string_view digits;
    bool integral = false;
    if (!require(kind::number) || !scan_number(digits, integral)) {
        return false;
    }
    const auto* const end = digits.data() + digits.size();
    if (std::from_chars(digits.data(), end, out).ec == std::errc{} && std::isfinite(out)) {
        return true;
    }
    double small = 1;
    if (std::from_chars(digits.data(), end, small).ec != std::errc{} || std::fabs(small) >= 1) {
        return fail("a number out of the range of a float");
    }
    out = static_cast<float>(small); // too small for a float of full precision
    return true;
}

bool json_reader::read_or_nan(double& out) {
    skip_space();
    if (ok() && json_detail::read_decimal(text_, at_, out)) {
        return true;
    }
    if (peek() == kind::null) {
        out = std::numeric_limits<double>::quiet_NaN();
        return read_null();
    }
    return read(out);
}

bool json_reader::read_or_nan(float& out) {
    if (peek() == kind::null) {
        out = std::numeric_limits<float>::quiet_NaN();
        return read_null();
    }
    return read(out);
}

template <class Integer>
bool json_reader::read_integer(Integer& out, std::string_view out_of_range) {
    std::string_view digits;
    bool integral = false;
    if (!require(kind::number) || !scan_number(digits, integral)) {
        return false;
    }
    return json_detail::read_number(digits, out) || fail(integral ? out_of_range : "expected an integer");
}

bool json_reader::read(std::int64_t& out) { return read_integer(out, "an integer out of range"); }

bool json_reader::read(std::uint64_t& out) { return read_integer(out, "an integer out of range (0 or more)"); }

// `out` is a view of the text, or of `decoded` if there are escapes.
bool json_reader::scan_string(std::string_view& out, std::string& decoded) {
    bool escaped = false;
    if (const auto wrong = json_detail::scan_string(text_, at_, out, escaped); !wrong.empty()) {
        return fail(wrong);
    }
    if (escaped) {
        if (!json_detail::unescape(out, decoded)) {
            return fail("an unpaired surrogate");
        }
        out = decoded;
    }
    return true;
}

bool json_reader::read(std::string_view& out) { return require(kind::string) && scan_string(out, scratch_); }

bool json_reader::read(std::string& out) {
    std::string_view text;
    if (!read(text)) {
        return false;
    }
    out = text;
    return true;
}

bool json_reader::skip() {
    if (!ok() || !skip_value(max_depth_ - depth_)) {
        return false;
    }
    first_ = false;
    return true;
}

// Recursion is bounded by the depth.
bool json_reader::skip_value(std::size_t depth) {
    std::string_view raw;
    switch (const auto c = look()) {
    case '{': return depth == 0 ? fail_too_deep() : skip_values('}', depth - 1);
    case '[': return depth == 0 ? fail_too_deep() : skip_values(']', depth - 1);
    case '"': {
        std::string ignored;
        return scan_string(raw, ignored);
    }
    case 't': return literal("true");
    case 'f': return literal("false");
    case 'n': return literal("null");
    default:
        bool integral = false;
        return c == '-' || json_detail::is_digit(c) ? scan_number(raw, integral) : expected("a value");
    }
}

// What is in the brackets of an object or array.
bool json_reader::skip_values(char close, std::size_t depth) {
    ++at_;
    if (look() == close) {
        ++at_;
        return true;
    }
    std::string_view key;
    std::string decoded;
    for (;;) {
        if ((close == '}' && !scan_key(key, decoded)) || !skip_value(depth)) {
            return false;
        }
        const auto c = look();
        if (c != ',' && c != close) {
            return expected(comma_or(close));
        }
        ++at_;
        if (c == close) {
            return true;
        }
    }
}

bool json_reader::read_raw(std::string_view& out) {
    skip_space();
    const auto start = at_;
    if (!skip()) {
        return false;
    }
    out = text_.substr(start, at_ - start);
    return true;
}

bool json_reader::at_end() {
    skip_space();
    return ok() && (at_ == text_.size() || fail("more text after the value"));
}

bool is_valid_json(std::string_view text, std::size_t max_depth, std::string* why) {
    json_reader reader{text, max_depth};
    if (reader.skip() && reader.at_end()) {
        return true;
    }
    if (why != nullptr) {
        *why = reader.error();
    }
    return false;
}

void append_compact_json(std::string_view text, std::string& out) {
    bool in_string = false;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const auto c = text[i];
        if (in_string) {
            out.push_back(c);
            if (c == '\\' && i + 1 < text.size()) {
                out.push_back(text[++i]);
            } else if (c == '"') {
                in_string = false;
            }
        } else if (c != ' ' && c != '\t' && c != '\n' && c != '\r') {
            out.push_back(c);
            in_string = c == '"';
        }
    }
}

} // namespace cles
