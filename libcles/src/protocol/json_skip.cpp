// SPDX-License-Identifier: BSL-1.0
#include "protocol/json_skip.hpp"

#include "protocol/json_scan.hpp"

#include <string>

namespace cles::protocol {
namespace {

using kind = json_flaw::kind;

// Recursion is bounded by the depth.
class skipper {
  public:
    skipper(std::string_view text, std::size_t at) noexcept : text_(text), at_(at) {}

    [[nodiscard]] std::size_t at() const noexcept { return at_; }

    json_flaw value(std::size_t depth) {
        switch (look()) {
        case '{': return depth == 0 ? json_flaw{kind::too_deep} : object(depth - 1);
        case '[': return depth == 0 ? json_flaw{kind::too_deep} : array(depth - 1);
        case '"': return string();
        case 't': return literal("true");
        case 'f': return literal("false");
        case 'n': return literal("null");
        case '-':
        case '0':
        case '1':
        case '2':
        case '3':
        case '4':
        case '5':
        case '6':
        case '7':
        case '8':
        case '9': return number();
        default: return {kind::expected, "a value"};
        }
    }

  private:
    // The next character that is no white space; 0 at the end.
    char look() noexcept {
        while (at_ < text_.size()) {
            const auto c = text_[at_];
            if (c > ' ' || (c != ' ' && c != '\t' && c != '\n' && c != '\r')) {
                return c;
            }
            ++at_;
        }
        return '\0';
    }

    json_flaw object(std::size_t depth) {
        ++at_;
        if (look() == '}') {
            ++at_;
            return {};
        }
        for (;;) {
            if (look() != '"') {
                return {kind::expected, "a member's name"};
            }
            if (const auto flaw = string(); flaw.what != kind::none) {
                return flaw;
            }
            if (look() != ':') {
                return {kind::expected, "':'"};
            }
            ++at_;
            if (const auto flaw = value(depth); flaw.what != kind::none) {
                return flaw;
            }
            const auto c = look();
            if (c != ',' && c != '}') {
                return {kind::expected, "',' or '}'"};
            }
            ++at_;
            if (c == '}') {
                return {};
            }
        }
    }

    json_flaw array(std::size_t depth) {
        ++at_;
        if (look() == ']') {
            ++at_;
            return {};
        }
        for (;;) {
            if (const auto flaw = value(depth); flaw.what != kind::none) {
                return flaw;
            }
            const auto c = look();
            if (c != ',' && c != ']') {
                return {kind::expected, "',' or ']'"};
            }
            ++at_;
            if (c == ']') {
                return {};
            }
        }
    }

    json_flaw string() {
        std::string_view raw;
        bool escaped = false;
        if (const auto wrong = scan_string(text_, at_, raw, escaped); !wrong.empty()) {
            return {kind::bad, wrong};
        }
        if (std::string ignored; escaped && !unescape(raw, ignored)) {
            return {kind::bad, "half of a surrogate pair"};
        }
        return {};
    }

    json_flaw number() {
        bool integral = false;
        const auto wrong = scan_number(text_, at_, integral);
        return wrong.empty() ? json_flaw{} : json_flaw{kind::bad, wrong};
    }

    json_flaw literal(std::string_view word) {
        if (text_.substr(at_, word.size()) != word) {
            return {kind::expected, word};
        }
        at_ += word.size();
        return {};
    }

    std::string_view text_;
    std::size_t at_;
};

} // namespace

json_flaw skip_json(std::string_view text, std::size_t& at, std::size_t max_depth) {
    skipper s{text, at};
    const auto flaw = s.value(max_depth);
    at = s.at();
    return flaw;
}

} // namespace cles::protocol
