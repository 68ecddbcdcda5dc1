// SPDX-License-Identifier: BSL-1.0
#include "client/suggestion.hpp"
#include "commands.hpp"
#include "output/errors.hpp"
#include "output/terminal.hpp"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include <algorithm>
#include <memory>
#include <string_view>
#include <vector>

namespace tool {
namespace {

std::vector<const CLI::App*> commands_in(const CLI::App& app) {
    return app.get_subcommands([](const CLI::App*) { return true; });
}

void append_option_names(std::vector<std::string>& names, const CLI::App& command) {
    for (const auto* option : command.get_options()) {
        for (const auto& name : option->get_lnames()) {
            names.push_back(name);
        }
    }
}

} // namespace

std::string overview_of(const CLI::App& app) {
    return app.get_formatter()->make_help(&app, app.get_name(), CLI::AppFormatMode::Normal);
}

std::string full_name_of(const CLI::App& command) {
    const auto* const parent = command.get_parent();
    return parent == nullptr ? command.get_name() : full_name_of(*parent) + " " + command.get_name();
}

void report_unknown_command(const CLI::App& app, const std::string& typed) {
    std::vector<std::string> names;
    for (const auto* command : commands_in(app)) {
        names.push_back(command->get_name());
    }
    const auto before = app.get_parent() == nullptr ? std::string{} : app.get_name() + " ";
    print_error("there is no command '" + before + typed + "'");
    if (const auto match = closest_match(typed, names); !match.empty()) {
        note("did you mean '" + full_name_of(app) + " " + match + "'?");
    }
}

void suggest_option(const CLI::App& app, const CLI::App& command, const std::string& word) {
    if (!word.starts_with("--")) {
        return;
    }
    std::vector<std::string> names;
    append_option_names(names, command);
    append_option_names(names, app);
    const auto typed = std::string_view{word}.substr(0, word.find('=')).substr(2);
    if (const auto match = closest_match(typed, names); !match.empty()) {
        note("did you mean '--" + match + "'?");
    }
}

void add_help(CLI::App& app, context& shared) {
    auto words = std::make_shared<std::vector<std::string>>();
    auto* command = app.add_subcommand("help", "Show what a command does, and its options");
    command->add_option("command", *words, "The command; without it, all commands are listed")->type_name("");
    command->footer("Examples:\n"
                    "  cles help\n"
                    "  cles help pull");
    command->callback([words, &app, &shared] {
        if (words->empty()) {
            write_output(overview_of(app));
            return;
        }
        const CLI::App* found = &app;
        for (const auto& word : *words) {
            const auto all = commands_in(*found);
            const auto next =
                std::find_if(all.begin(), all.end(), [&](const CLI::App* each) { return each->get_name() == word; });
            if (next == all.end()) {
                report_unknown_command(*found, word);
                shared.exit_code = exit_code::usage;
                return;
            }
            found = *next;
        }
        write_output(found->help(full_name_of(*found->get_parent())));
    });
}

} // namespace tool
