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

// A subcommand knows the program's options too.
CLI::Option* find_option(CLI::App& app, CLI::App& command, std::string_view word) {
    const std::string name{word.substr(0, word.find('='))};
    auto* option = command.get_option_no_throw(name);
    return option != nullptr ? option : app.get_option_no_throw(name);
}

bool takes_value(const CLI::Option* option) { return option != nullptr && option->get_items_expected_max() > 0; }

CLI::Option* find_positional(CLI::App& command, std::size_t which) {
    const auto all = command.get_options([](const CLI::Option* option) { return option->get_positional(); });
    return which < all.size() ? all[which] : nullptr;
}

bool is_option(const std::string& word) { return word.size() > 1 && word.front() == '-'; }

} // namespace

cursor find_cursor(CLI::App& app, std::vector<std::string> words) {
    cursor here{.command = &app};
    if (words.empty()) {
        words.emplace_back();
    }
    here.typed = std::move(words.back());
    words.pop_back();
    here.words = std::move(words);

    bool no_more_options = false;
    std::size_t positionals = 0;
    for (std::size_t i = 0; i < here.words.size(); ++i) {
        const auto& word = here.words[i];
        if (!no_more_options && word == "--") {
            no_more_options = true;
        } else if (!no_more_options && is_option(word)) {
            auto* option = find_option(app, *here.command, word);
            if (takes_value(option) && word.find('=') == std::string::npos && ++i == here.words.size()) {
                here.option = option;
            }
        } else if (here.command != &app) {
            ++positionals;
        } else if (here.command = find_command(app, word); here.command == nullptr) {
            return here;
        }
    }

    const auto equals = here.typed.find('=');
    if (here.option != nullptr) {
        here.words.pop_back(); // its name, which says nothing yet
        here.what = cursor::at::value;
    } else if (!no_more_options && here.typed.starts_with("--") && equals != std::string::npos) {
        here.option = find_option(app, *here.command, here.typed);
        here.what = takes_value(here.option) ? cursor::at::value : cursor::at::nothing;
        here.before = here.typed.substr(0, equals + 1);
        here.typed.erase(0, equals + 1);
    } else if (!no_more_options && here.typed.starts_with("-")) {
        here.what = cursor::at::option;
    } else if (here.command == &app) {
        here.what = cursor::at::command;
    } else {
        here.option = find_positional(*here.command, positionals);
        here.what = here.option != nullptr ? cursor::at::value : cursor::at::nothing;
    }
    return here;
}

} // namespace tool
