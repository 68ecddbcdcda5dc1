// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Rights, read and compared in the simplest way, to compare the library's answers with.

namespace cles::fuzz {

inline std::vector<std::string> split(std::string_view text, char at) {
    std::vector<std::string> out{{}};
    for (const char c : text) {
        if (c == at) {
            out.emplace_back();
        } else {
            out.back().push_back(c);
        }
    }
    return out;
}

inline int hex_digit(char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

/// One part of a noun or of a pattern: its characters, where nothing stands for a wildcard.
using naive_part = std::vector<std::optional<char>>;

inline naive_part read_part(std::string_view text, bool is_pattern) {
    naive_part out;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '%' && i + 2 < text.size() && hex_digit(text[i + 1]) >= 0 && hex_digit(text[i + 2]) >= 0) {
            out.emplace_back(static_cast<char>(hex_digit(text[i + 1]) * 16 + hex_digit(text[i + 2])));
            i += 2;
        } else if (text[i] == '*' && is_pattern) {
            out.emplace_back(std::nullopt);
        } else {
            out.emplace_back(text[i]);
        }
    }
    return out;
}

/// Whether the first characters of the text match the first of the pattern, for all lengths of both.
inline bool naive_match(const naive_part& pattern, const naive_part& text) {
    std::vector<bool> reached(text.size() + 1);
    reached[0] = true;
    for (const auto& wanted : pattern) {
        std::vector<bool> next(text.size() + 1);
        for (std::size_t i = 0; i <= text.size(); ++i) {
            if (!wanted) {
                next[i] = reached[i] || (i > 0 && next[i - 1]);
            } else if (i > 0) {
                next[i] = reached[i - 1] && text[i - 1] == wanted;
            }
        }
        reached = next;
    }
    return reached[text.size()];
}

/// Whether a right of valid form permits the verb, in small letters, on a valid noun.
inline bool naive_permits(std::string_view right, std::string_view verb, std::string_view noun) {
    const auto space = right.find(' ');
    bool has_verb = right.substr(0, space) == "*";
    for (const auto& listed : split(right.substr(0, space), ',')) {
        has_verb = has_verb || listed == verb;
    }
    auto pattern = right.substr(space + 1);
    const bool further = pattern.ends_with("/**");
    if (further) {
        pattern.remove_suffix(3);
    }
    const auto parts_of = [](std::string_view text) {
        auto parts = split(text.substr(text.find(':') + 1), '/');
        parts.insert(parts.begin(), std::string{text.substr(0, text.find(':'))});
        return parts;
    };
    const auto wanted = parts_of(pattern);
    const auto given = parts_of(noun);
    bool matches = has_verb && (further ? given.size() >= wanted.size() : given.size() == wanted.size());
    for (std::size_t i = 0; matches && i < wanted.size(); ++i) {
        matches = naive_match(read_part(wanted[i], true), read_part(given[i], false));
    }
    return matches;
}

} // namespace cles::fuzz
