// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
} // namespace CLI

namespace tool {

/// What is being typed at the end of an incomplete command line.
struct cursor {
    enum class at { command, option, value, nothing };

    at what = at::nothing;
    CLI::App* command = nullptr;      ///< the innermost one, or the program itself
    CLI::Option* option = nullptr;    ///< whose `value` is typed; positional arguments are options too
    std::string before{};             ///< what precedes it in the same word, as in "--output="
    std::string typed{};              ///< the part that has been typed
    std::vector<std::string> words{}; ///< the complete words before it
};

/// The last word is being typed, and may be empty.
cursor find_cursor(CLI::App& app, std::vector<std::string> words);

} // namespace tool
