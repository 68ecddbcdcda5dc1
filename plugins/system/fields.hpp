// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <charconv>
#include <string_view>

namespace sysinfo {

/// The words of a line of a kernel's file, one after the other; empty, and 0, where there are no more.
class fields {
  public:
    explicit fields(std::string_view line) noexcept : rest_(line) {}

    std::string_view next() noexcept {
        const auto begin = rest_.find_first_not_of(" \t");
        if (begin == std::string_view::npos) {
            rest_ = {};
            return {};
        }
        rest_.remove_prefix(begin);
        const auto word = rest_.substr(0, rest_.find_first_of(" \t"));
        rest_.remove_prefix(word.size());
        return word;
    }
    template <class T>
    T number() noexcept {
        const auto word = next();
        T value{};
        std::from_chars(word.data(), word.data() + word.size(), value);
        return value;
    }
    void skip(int words) noexcept {
        while (words-- > 0) {
            next();
        }
    }

  private:
    std::string_view rest_;
};

/// Takes the next line off the text; false where none is left.
inline bool next_line(std::string_view& text, std::string_view& line) noexcept {
    if (text.empty()) {
        return false;
    }
    line = text.substr(0, text.find('\n'));
    text.remove_prefix(line.size() == text.size() ? line.size() : line.size() + 1);
    return true;
}

} // namespace sysinfo
