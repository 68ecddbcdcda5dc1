// SPDX-License-Identifier: BSL-1.0
#include "completion/candidates.hpp"

#include "discovery/host.hpp"
#include "options/saved_contexts.hpp"

#include <CLI/App.hpp>
#include <CLI/Error.hpp>
#include <CLI/Option.hpp>

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace tool {
namespace {

// The first part of a help text, without details.
std::string short_form(const std::string& help) {
    const auto words = help.substr(0, help.find_first_of(":;(\n"));
    return words.substr(0, words.find_last_not_of(' ') + 1);
}

void append_options(std::vector<candidate>& out, CLI::App& command) {
    for (const auto* option : command.get_options()) {
        if (option->get_group().empty()) { // hidden
            continue;
        }
        for (const auto& name : option->get_lnames()) {
            out.push_back({"--" + name, short_form(option->get_description())});
        }
        for (const auto& name : option->get_snames()) {
            out.push_back({"-" + name, short_form(option->get_description())});
        }
    }
}

// CLI11 does not list the values of an option, but says of each word whether it is valid.
std::vector<candidate> keywords_of(CLI::Option& option) {
    constexpr std::array keywords{"table",    "json",  "raw",  "tcp",  "udp",      "unix",      "inproc",
                                  "bash",     "zsh",   "fish", "name", "load",     "multicast", "coroutine",
                                  "callback", "batch", "pull", "push", "delegate", "bind",      "update"};
    std::vector<candidate> out;
    try {
        const auto& accepts = *option.get_validator();
        for (std::string word : keywords) {
            if (accepts(word).empty()) {
                out.push_back({word});
            }
        }
    } catch (const CLI::OptionNotFound&) {
        return {}; // it takes any value
    }
    return out;
}

std::vector<candidate> interface_names() {
    std::vector<candidate> out{{"off", "no multicast"}};
    for (const auto& interface : network_interfaces()) {
        out.push_back({interface.name, interface.address});
    }
    return out;
}

std::vector<candidate> context_names() {
    std::vector<candidate> out;
    for (const auto& [name, each] : read_contexts().contexts) {
        out.push_back({name, each.at});
    }
    return out;
}

enum class entries : std::uint8_t { all, folders };

// The files at a path that has been typed, each after `before`.
std::vector<candidate> files_at(const std::string& path, const std::string& before, entries wanted) {
    const auto folder = path.substr(0, path.find_last_of('/') + 1);
    std::vector<candidate> out;
    std::error_code code;
    std::filesystem::directory_iterator entry{folder.empty() ? "." : folder, code};
    for (; !code && entry != std::filesystem::directory_iterator{}; entry.increment(code)) {
        std::error_code unknown;
        const bool is_folder = entry->is_directory(unknown);
        if (is_folder || wanted == entries::all) {
            out.push_back({before + folder + entry->path().filename().string() + (is_folder ? "/" : "")});
        }
    }
    return out;
}

std::vector<candidate> bodies_at(const std::string& typed) {
    if (!typed.starts_with("@")) {
        return {{"@", "a file"}, {"-", "stdin"}};
    }
    return files_at(typed.substr(1), "@", entries::all);
}

} // namespace

std::vector<candidate> commands_of(CLI::App& app) {
    std::vector<candidate> out;
    for (const auto* command : app.get_subcommands([](const CLI::App*) { return true; })) {
        if (!command->get_group().empty()) {
            out.push_back({command->get_name(), short_form(command->get_description())});
        }
    }
    return out;
}

std::vector<candidate> options_at(CLI::App& app, const cursor& cursor) {
    std::vector<candidate> out;
    append_options(out, *cursor.command);
    if (cursor.command != &app) {
        for (const auto* name : {"-v", "--verbose"}) {
            out.push_back({name, "Log more on stderr"});
        }
    }
    return out;
}

std::vector<candidate> values_at(const cursor& cursor) {
    const std::string kind = cursor.option->get_type_name();
    if (kind.starts_with("IFACE")) {
        return interface_names();
    }
    if (kind == "JSON") {
        return bodies_at(cursor.typed);
    }
    if (kind == "CONTEXT") {
        return context_names();
    }
    if (kind == "FILE" || kind == "DIR") {
        return files_at(cursor.typed, "", kind == "FILE" ? entries::all : entries::folders);
    }
    return keywords_of(*cursor.option);
}

} // namespace tool
