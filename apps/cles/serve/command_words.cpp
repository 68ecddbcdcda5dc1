// SPDX-License-Identifier: BSL-1.0
#include "serve/command_words.hpp"

#include "output/errors.hpp"

#include <cstddef>

namespace tool {

std::vector<std::string> words_of_command(std::string_view command) {
    std::vector<std::string> words;
    bool in_word = false; // also of an empty quotation
    char quote = 0;
    const auto begin = [&] {
        if (!in_word) {
            words.emplace_back();
            in_word = true;
        }
    };
    const auto add = [&](char c) {
        begin();
        words.back().push_back(c);
    };
    for (std::size_t i = 0; i < command.size(); ++i) {
        const char c = command[i];
        if (quote != 0 && c == quote) {
            quote = 0;
        } else if (c == '\\' && quote != '\'' && i + 1 < command.size()) {
            add(command[++i]);
        } else if (quote == 0 && (c == '\'' || c == '"')) {
            quote = c;
            begin();
        } else if (quote == 0 && (c == ' ' || c == '\t' || c == '\n')) {
            in_word = false;
        } else {
            add(c);
        }
    }
    if (quote != 0) {
        throw usage_error("--exec '" + std::string{command} + "': a quotation does not end");
    }
    if (words.empty() || words.front().empty()) {
        throw usage_error("--exec '" + std::string{command} + "' names no program");
    }
    return words;
}

} // namespace tool
