// SPDX-License-Identifier: BSL-1.0
#include <cles/json_reader.hpp>

#include "json/characters.hpp"
#include "json/json_scan.hpp"

#include <charconv>
#include <system_error>

namespace cles {
namespace {

std::string_view name_of(json_reader::kind k) noexcept {
    switch (k) {
    case json_reader::kind::object: return "an object";
    case json_reader::kind::array: return "an array";
    case json_reader::kind::string: return "a string";
    case json_reader::kind::number: return "a number";
    case json_reader::kind::boolean: return "true or false";
    case json_reader::kind::null: return "null";
    case json_reader::kind::invalid: break;
    }
    return "something that is not JSON";
}

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

void json_reader::inside_member(std::string_view name) {
    if (!path_.empty() && path_.front() != '[') {
        path_.insert(0, ".");
    }
    path_.insert(0, name);
}

void json_reader::inside_element(std::size_t index) {
    if (!path_.empty() && path_.front() != '[') {
        path_.insert(0, ".");
    }
    path_.insert(0, "[" + std::to_string(index) + "]");
}

std::string json_reader::error() const {
    if (ok()) {
        return {};
    }
    std::string text;
    if (!path_.empty()) {
        text.append(path_).append(": ");
    }
    return text.append(message_).append(" (at byte ").append(std::to_string(failed_at_)).append(")");
}

json_reader::kind json_reader::peek() noexcept {
    skip_space();
    if (at_ >= text_.size()) {
        return kind::invalid;
    }
    switch (const auto c = text_[at_]) {
    case '{': return kind::object;
    case '[': return kind::array;
    case '"': return kind::string;
    case 't':
    case 'f': return kind::boolean;
    case 'n': return kind::null;
    default: return c == '-' || json_detail::is_digit(c) ? kind::number : kind::invalid;
    }
}

bool json_reader::fail_too_deep() { return fail("deeper than " + std::to_string(max_depth_) + " brackets"); }

bool json_reader::enter() {
    if (depth_ == max_depth_) {
        return fail_too_deep();
    }
    ++depth_;
    ++at_;
    first_ = true;
    return true;
}

bool json_reader::begin_object() { return ok() && (peek() == kind::object ? enter() : expected("an object")); }

bool json_reader::begin_array() { return ok() && (peek() == kind::array ? enter() : expected("an array")); }

bool json_reader::next_key(std::string_view& key) {
    if (!ok()) {
        return false;
    }
    skip_space();
    if (at_ < text_.size() && text_[at_] == '}') {
        ++at_;
        --depth_;
        first_ = false;
        return false;
    }
    if (!first_) {
        if (at_ >= text_.size() || text_[at_] != ',') {
            return expected("',' or '}'");
        }
        ++at_;
    }
    first_ = false;
    if (peek() != kind::string) {
        return expected("a member's name");
    }
    if (!read(key)) {
        return false;
    }
    skip_space();
    if (at_ >= text_.size() || text_[at_] != ':') {
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

bool json_reader::next_element() {
    if (!ok()) {
        return false;
    }
    skip_space();
    if (at_ < text_.size() && text_[at_] == ']') {
        ++at_;
        --depth_;
        first_ = false;
        return false;
    }
    if (!first_) {
        if (at_ >= text_.size() || text_[at_] != ',') {
            return expected("',' or ']'");
        }
        ++at_;
    }
    first_ = false;
    return true;
}

bool json_reader::literal(std::string_view word) {
    if (text_.substr(at_, word.size()) != word) {
        return expected(word);
    }
    at_ += word.size();
    return true;
}

bool json_reader::read_null() { return ok() && (peek() == kind::null ? literal("null") : expected("null")); }

bool json_reader::read(bool& out) {
    if (!ok()) {
        return false;
    }
    if (peek() != kind::boolean) {
        return expected("true or false");
    }
    out = text_[at_] == 't';
    return literal(out ? "true" : "false");
}

bool json_reader::scan_number(std::string_view& out, bool& integral) {
    if (!ok()) {
        return false;
    }
    if (peek() != kind::number) {
        return expected("a number");
    }
    const auto start = at_;
    if (const auto wrong = json_detail::scan_number(text_, at_, integral); !wrong.empty()) {
        return fail(wrong);
    }
    out = text_.substr(start, at_ - start);
    return true;
}

bool json_reader::read(double& out) {
    if (ok() && peek() == kind::number && json_detail::read_short_decimal(text_, at_, out)) {
        return true;
    }
    std::string_view digits;
    bool integral = false;
    if (!scan_number(digits, integral)) {
        return false;
    }
    if (std::from_chars(digits.data(), digits.data() + digits.size(), out).ec != std::errc{}) {
        return fail("a number out of the range of a double");
    }
    return true;
}

namespace {

template <class Integer>
bool to_integer(std::string_view digits, Integer& out) noexcept {
    const auto end = digits.data() + digits.size();
    const auto [ptr, code] = std::from_chars(digits.data(), end, out);
    return code == std::errc{} && ptr == end;
}

} // namespace

bool json_reader::read(std::int64_t& out) {
    std::string_view digits;
    bool integral = false;
    if (!scan_number(digits, integral)) {
        return false;
    }
    return to_integer(digits, out) || fail(integral ? "an integer out of range" : "expected an integer");
}

bool json_reader::read(std::uint64_t& out) {
    std::string_view digits;
    bool integral = false;
    if (!scan_number(digits, integral)) {
        return false;
    }
    return to_integer(digits, out) || fail(integral ? "an integer out of range (0 or more)" : "expected an integer");
}

bool json_reader::scan_string(std::string_view& raw, bool& escaped) {
    const auto wrong = json_detail::scan_string(text_, at_, raw, escaped);
    return wrong.empty() || fail(wrong);
}

bool json_reader::read(std::string_view& out) {
    if (!ok()) {
        return false;
    }
    if (peek() != kind::string) {
        return expected("a string");
    }
    bool escaped = false;
    if (!scan_string(out, escaped)) {
        return false;
    }
    if (escaped) {
        if (!json_detail::unescape(out, scratch_)) {
            return fail("half of a surrogate pair");
        }
        out = scratch_;
    }
    return true;
}

bool json_reader::read(std::string& out) {
    std::string_view text;
    if (!read(text)) {
        return false;
    }
    out = text;
    return true;
}

bool json_reader::skip() {
    if (!ok()) {
        return false;
    }
    const auto flaw = json_detail::skip_json(text_, at_, max_depth_ - depth_);
    switch (flaw.what) {
    case json_detail::json_error::kind::none: break;
    case json_detail::json_error::kind::expected: return expected(flaw.text);
    case json_detail::json_error::kind::bad: return fail(flaw.text);
    case json_detail::json_error::kind::too_deep: return fail_too_deep();
    }
    first_ = false;
    return true;
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
