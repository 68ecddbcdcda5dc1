// SPDX-License-Identifier: BSL-1.0
#include <cles/json_writer.hpp>
#include <cles/security/node_files.hpp>

#include "commands.hpp"
#include "options/arguments.hpp"
#include "options/keys_option.hpp"
#include "output/errors.hpp"
#include "output/printer.hpp"
#include "output/terminal.hpp"
#include "trust/carried_file.hpp"
#include "trust/rights_options.hpp"
#include "trust/run_with_keys.hpp"
#include "trust/trust_paths.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <memory>
#include <string>

namespace tool {

namespace security = cles::security;

namespace {

struct keys_arguments {
    keys_option keys;
    std::string name;
    std::string file;
    output_format format = output_format::automatic;
};

// --- new ---

void create_key(const keys_arguments& args) {
    check_node_name(args.name);
    const auto directory = args.keys.directory();
    create_parents(directory);
    const auto made = security::create_node_key(directory, args.name);
    write_output(printable(made.file) + "\n");
    note("created the private key of " + args.name + ", which stays in " + directory);
    note("its fingerprint is " + made.fingerprint + ": compare it with what 'cles fleet add' prints");
    note("next: carry " + made.file + " to the fleet's authority, and run there: cles fleet add " + args.name +
         ".pub --may RIGHT");
}

void add_new(CLI::App& keys, context& shared) {
    auto args = std::make_shared<keys_arguments>();
    auto* command = keys.add_subcommand("new", "Create the private key of a node");
    command->add_option("name", args->name, "The node's name")->required()->type_name("");
    args->keys.add_to(*command, "The node's directory, which is created if it does not exist");
    command->footer("Prints the path of the file that is carried to the fleet's authority. The private key is never\n"
                    "replaced, printed or carried.\n\n"
                    "Examples:\n"
                    "  cles keys new car1\n"
                    "  cles keys new car1 --keys /etc/cles/car1");
    run_with_keys(*command, shared, args, create_key);
}

// --- show ---

std::string node_text(const security::node_description& node) {
    std::string out = "node      " + printable(node.name) + "\nkey       " + node.key + "\n          fingerprint " +
                      node.fingerprint + "\n";
    if (node.fleet.empty()) {
        return out + "fleet     none: " + printable(node.reason) + "\n";
    }
    out += "fleet     " + node.fleet + "\nroster    version " + std::to_string(node.version) + "\n";
    out += node.rights ? rights_lines(*node.rights) : "member    no: " + printable(node.reason) + "\n";
    const auto rules = std::to_string(node.rules) + (node.rules == 1 ? " rule" : " rules");
    return out + "rules     " +
           (node.rules_error.empty() ? rules : "everything is denied: " + printable(node.rules_error)) + "\n";
}

std::string node_json(const security::node_description& node) {
    std::string out;
    cles::json_writer w{out};
    w.begin_object();
    w.key("name");
    w.value(std::string_view{node.name});
    w.key("key");
    w.value(std::string_view{node.key});
    w.key("fingerprint");
    w.value(std::string_view{node.fingerprint});
    if (!node.fleet.empty()) {
        w.key("fleet");
        w.value(std::string_view{node.fleet});
        w.key("version");
        w.value(std::uint64_t{node.version});
    }
    w.key("member");
    w.value(node.rights.has_value());
    if (node.rights) {
        write_rights(w, *node.rights);
    } else {
        w.key("reason");
        w.value(std::string_view{node.reason});
    }
    w.key("rules");
    w.value(std::uint64_t{node.rules});
    if (!node.rules_error.empty()) {
        w.key("rules_error");
        w.value(std::string_view{node.rules_error});
    }
    w.end_object();
    return out;
}

void show_keys(const keys_arguments& args) {
    const auto node = security::describe_node(args.keys.directory());
    if (resolved(args.format) == output_format::table) {
        write_output(node_text(node));
    } else {
        printer{args.format, false}.print(node_json(node));
    }
    for (const auto& warning : node.warnings) {
        note(warning);
    }
}

void add_show(CLI::App& keys, context& shared) {
    auto args = std::make_shared<keys_arguments>();
    auto* command = keys.add_subcommand("show", "Show a node's public key, its fleet, and its rights");
    args->keys.add_to(*command, "The node's directory");
    add_output_option(*command, args->format);
    command->footer("Examples:\n"
                    "  cles keys show\n"
                    "  cles keys show --keys /etc/cles/car1 -o json | jq -r .version");
    run_with_keys(*command, shared, args, show_keys);
}

// --- join ---

void join(const keys_arguments& args) {
    const auto line = read_carried_file(args.file);
    const auto node = naming_file(args.file, [&] { return security::join_fleet(args.keys.directory(), line); });
    write_output(node.fleet + "\n");
    note(node.name + " is a member of the fleet with this key, by version " + std::to_string(node.version) +
         " of the roster");
    for (const auto& warning : node.warnings) {
        note(warning);
    }
}

void add_join(CLI::App& keys, context& shared) {
    auto args = std::make_shared<keys_arguments>();
    auto* command = keys.add_subcommand("join", "Store a roster, which makes the node a member of a fleet");
    command->add_option("file", args->file, "NAME.join or a newer roster, as the authority wrote it; - is stdin")
        ->required()
        ->type_name("FILE");
    args->keys.add_to(*command, "The node's directory");
    command->footer(
        "Prints the public key of the fleet. Compare it with what 'cles fleet show' prints at the authority:\n"
        "the node trusts this fleet from now on.\n\n"
        "Examples:\n"
        "  cles keys join car1.join\n"
        "  ssh authority cat fleet/car1.join | cles keys join -");
    run_with_keys(*command, shared, args, join);
}

// --- cert ---

void write_certificate(const keys_arguments& args) {
    const auto directory = args.keys.directory();
    const auto file = security::write_certificate(directory);
    write_output(printable(file) + "\n");
    note("the file contains the private key, as 'key' does, and stays in " + directory);
}

void add_cert(CLI::App& keys, context& shared) {
    auto args = std::make_shared<keys_arguments>();
    auto* command = keys.add_subcommand("cert", "Write the key and its certificate for other programs, as PEM");
    args->keys.add_to(*command, "The node's directory");
    command->footer(
        "Prints the path of the file, tls.pem in that directory, which only its owner can read. The Python\n"
        "package needs it for tls://. It stays valid as long as the key.\n\n"
        "Examples:\n"
        "  cles keys cert\n"
        "  cles keys cert --keys /etc/cles/car1");
    run_with_keys(*command, shared, args, write_certificate);
}

} // namespace

void add_keys(CLI::App& app, context& shared) {
    auto* keys = app.add_subcommand("keys", "Create and show the key of a node, and join a fleet");
    keys->require_subcommand(1);
    keys->footer("Examples:\n"
                 "  cles keys new car1                  # on the node\n"
                 "  cles fleet add car1.pub --may all   # at the fleet's authority\n"
                 "  cles keys join car1.join            # on the node");
    add_new(*keys, shared);
    add_show(*keys, shared);
    add_join(*keys, shared);
    add_cert(*keys, shared);
}

} // namespace tool
