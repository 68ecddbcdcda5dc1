// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>

#include "commands.hpp"
#include "options/addresses.hpp"
#include "options/arguments.hpp"
#include "options/saved_contexts.hpp"
#include "output/errors.hpp"
#include "output/printer.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace tool {
namespace {

struct context_arguments {
    std::string name{};
    address_book addresses{};
    output_format format = output_format::automatic;
};

// --- save ---

void save_context(context_arguments& args) {
    if (!is_name(args.name)) {
        throw usage_error("'" + args.name + "' is not the name of a context: 1 to 64 letters, digits, '_', '-', '.'");
    }
    args.addresses.leave_context();
    args.addresses.check();
    auto given = args.addresses.given();
    if (given == saved_context{}) {
        throw usage_error("what is to be saved? Give at least one of --at, --peer, --keys, --multicast and --pool");
    }
    if (!given.keys.empty()) { // commands run in other folders
        given.keys = std::filesystem::absolute(given.keys).string();
    }
    auto all = read_contexts();
    all.contexts[args.name] = given;
    write_contexts(all);
}

void add_save(CLI::App& contexts) {
    auto args = std::make_shared<context_arguments>();
    auto* command = contexts.add_subcommand("save", "Save these options under a name, or replace those of that name");
    command->add_option("name", args->name, "The name of the context")->required()->type_name("CONTEXT");
    args->addresses.add_options(*command);
    command->footer("Examples:\n"
                    "  cles context save lab --at tcp://10.0.0.7 --pool north\n"
                    "  cles context save fleet --keys ~/.config/cles/operator --multicast eth0");
    command->callback([args] { save_context(*args); });
}

// --- use ---

void use_context(const context_arguments& args) {
    auto all = read_contexts();
    if (!args.name.empty() && !all.contexts.contains(args.name)) {
        throw usage_error("there is no context '" + args.name + "'; 'cles context list' shows them");
    }
    all.used = args.name;
    write_contexts(all);
}

void add_use(CLI::App& contexts) {
    auto args = std::make_shared<context_arguments>();
    auto* command = contexts.add_subcommand("use", "Use a context from now on, or none");
    command->add_option("name", args->name, "The name of the context (default: none is used)")->type_name("CONTEXT");
    command->footer(
        "Options and variables such as --at and CLES_AT take precedence over the context. CLES_CONTEXT names\n"
        "another one for a shell; empty, it means none.\n\n"
        "Examples:\n"
        "  cles context use lab\n"
        "  cles context use");
    command->callback([args] { use_context(*args); });
}

// --- list ---

std::string contexts_table(const saved_contexts& all, std::string_view used) {
    table out{"USED", "CONTEXT", "AT", "PEERS", "KEYS", "MULTICAST", "POOL"};
    for (const auto& [name, each] : all.contexts) {
        out.row();
        out.set(0, name == used ? "*" : "");
        out.set(1, printable(name));
        out.set(2, printable(each.at));
        out.set(3, printable(joined(each.peers, " ")));
        out.set(4, printable(each.keys));
        out.set(5, printable(each.multicast));
        out.set(6, printable(each.pool));
    }
    return out.text();
}

std::string contexts_json(const saved_contexts& all, const std::string& used) {
    auto shown = all;
    shown.used = used;
    return cles::to_json(shown);
}

void list_contexts(const context_arguments& args) {
    const auto all = read_contexts();
    const auto used = name_of_used_context(all);
    if (resolved(args.format) == output_format::table) {
        write_output(contexts_table(all, used));
    } else {
        printer{args.format, false}.print(contexts_json(all, used));
    }
}

void add_list(CLI::App& contexts) {
    auto args = std::make_shared<context_arguments>();
    auto* command = contexts.add_subcommand("list", "List the contexts");
    add_output_option(*command, args->format);
    command->footer("Examples:\n"
                    "  cles context list");
    command->callback([args] { list_contexts(*args); });
}

} // namespace

void add_context(CLI::App& app) {
    auto* contexts = app.add_subcommand("context", "Save options such as --at and --keys, and use them by default");
    contexts->require_subcommand(1);
    contexts->footer("A context is the address, the key, the network and the pool of commands that talk to nodes.\n\n"
                     "Examples:\n"
                     "  cles context save lab --at tcp://10.0.0.7\n"
                     "  cles context use lab\n"
                     "  cles ls                                 # lists the nodes there");
    add_save(*contexts);
    add_use(*contexts);
    add_list(*contexts);
}

} // namespace tool
