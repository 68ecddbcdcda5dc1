// SPDX-License-Identifier: BSL-1.0
#include "completion/cursor.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <algorithm>
#include <cstddef>
#include <string_view>
#include <utility>

namespace tool {
namespace {

CLI::App* find_command(CLI::App& app, const std::string& name) {
    const auto found = app.get_subcommands([&](CLI::App* command) { return command->get_name() == name; });
    return found.empty() ? nullptr : found.front();
}

// The options of the program are valid in a subcommand too.
CLI::Option* find_option(CLI::App& app, CLI::App& command, std::string_view word) {
    const std::string name{word.substr(0, word.find('='))};
    auto* option = command.get_option_no_throw(name);
    return option != nullptr ? option : app.get_option_no_throw(name);
}

bool takes_value(const CLI::Option* option) { return option != nullptr && option->get_items_expected_max() > 0; }

// The last one may take several words.
CLI::Option* find_positional(CLI::App& command, std::size_t which) {
    const auto all = command.get_options([](const CLI::Option* option) { return option->get_positional(); });
    if (which < all.size()) {
        return all[which];
    }
    return !all.empty() && all.back()->get_items_expected_max() > 1 ? all.back() : nullptr;
}

bool has_commands(const CLI::App& command) { return command.get_require_subcommand_min() > 0; }

bool is_option(const std::string& word) { return word.size() > 1 && word.front() == '-'; }

} // namespace

cursor find_cursor(CLI::App& app, std::vector<std::string> words) {
    cursor out{.command = &app};
    if (words.empty()) {
        words.emplace_back();
    }
    out.typed = std::move(words.back());
    words.pop_back();
    out.words = std::move(words);

    bool no_more_options = false;
    std::size_t positionals = 0;
    for (std::size_t i = 0; i < out.words.size(); ++i) {
        const auto& word = out.words[i];
        if (!no_more_options && word == "--") {
            no_more_options = true;
        } else if (!no_more_options && is_option(word)) {
            auto* option = find_option(app, *out.command, word);
            if (takes_value(option) && word.find('=') == std::string::npos && ++i == out.words.size()) {
                out.option = option;
            }
        } else if (!has_commands(*out.command)) {
            ++positionals;
        } else if (out.command = find_command(*out.command, word); out.command == nullptr) {
            return out;
        }
    }

    const auto equals = out.typed.find('=');
    if (out.option != nullptr) {
        out.words.pop_back(); // its name, which is incomplete without a value
        out.what = cursor::at::value;
    } else if (!no_more_options && out.typed.starts_with("--") && equals != std::string::npos) {
        out.option = find_option(app, *out.command, out.typed);
        out.what = takes_value(out.option) ? cursor::at::value : cursor::at::nothing;
        out.before = out.typed.substr(0, equals + 1);
        out.typed.erase(0, equals + 1);
    } else if (!no_more_options && out.typed.starts_with("-")) {
        out.what = cursor::at::option;
    } else if (has_commands(*out.command)) {
        out.what = cursor::at::command;
    } else {
        out.option = find_positional(*out.command, positionals);
        out.what = out.option != nullptr ? cursor::at::value : cursor::at::nothing;
    }
    return out;
}

} // namespace tool
