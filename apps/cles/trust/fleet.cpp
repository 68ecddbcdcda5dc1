// SPDX-License-Identifier: BSL-1.0
#include <cles/security/fleet_files.hpp>
#include <cles/security/member_names.hpp>
#include <cles/security/node_files.hpp>

#include "commands.hpp"
#include "options/keys_option.hpp"
#include "output/errors.hpp"
#include "output/terminal.hpp"
#include "trust/carried_file.hpp"
#include "trust/fleet_show.hpp"
#include "trust/rights_options.hpp"
#include "trust/run_with_keys.hpp"
#include "trust/trust_paths.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace tool {

namespace security = cles::security;

namespace {

constexpr auto authority_help = "The authority's directory, which has the fleet's key";

struct fleet_arguments {
    keys_option keys;
    rights_options rights;
    std::string directory;
    std::string with;
    std::vector<std::string> files;
    std::vector<std::string> names;
};

// What is left to do after a change.
void note_new_roster(const std::string& directory) {
    const auto now = security::describe_fleet(directory);
    note("version " + std::to_string(now.version) + " of the roster is in " + directory);
    if (!now.members.empty()) {
        note("next: carry " + in_folder(directory, "roster") +
             " to one of the members, and run there: cles keys join roster; the others get it from that one");
    }
}

// --- init ---

struct new_node {
    std::string name;
    std::string folder;
};

// Those in "car1,car2", each in a folder of its own.
std::vector<new_node> nodes_in(const std::string& list, const std::string& directory) {
    const auto refuse = [&](const std::string& why) { throw usage_error("--with '" + list + "': " + why); };
    std::vector<new_node> out;
    std::istringstream from{list};
    for (std::string name; std::getline(from, name, ',');) {
        check_node_name(name);
        if (std::ranges::find(out, name, &new_node::name) != out.end()) {
            refuse("a name is there twice");
        }
        try {
            out.push_back({name, security::member_folder(directory, name)});
        } catch (const std::runtime_error& e) {
            refuse(e.what());
        }
    }
    if (!list.empty() && (out.empty() || list.ends_with(','))) {
        refuse("write names, as in car1,car2");
    }
    return out;
}

void create_nodes(const std::string& directory, const std::vector<new_node>& nodes) {
    std::vector<std::string> lines;
    lines.reserve(nodes.size());
    for (const auto& node : nodes) {
        lines.push_back(security::create_node_key(node.folder, node.name).line);
    }
    security::add_members(directory, lines, {});
    const auto roster = security::describe_fleet(directory).line;
    for (const auto& node : nodes) {
        security::join_fleet(node.folder, roster);
        write_output(printable(node.folder) + "\n");
    }
}

void init(const fleet_arguments& args) {
    const auto nodes = nodes_in(args.with, args.directory);
    for (const auto& node : nodes) {
        if (std::filesystem::exists(node.folder)) {
            throw std::runtime_error(node.folder + " already exists");
        }
    }
    create_parents(args.directory);
    const auto made = security::create_fleet(args.directory);
    write_output(printable(args.directory) + "\n");
    note("created a fleet with the public key " + made.fleet);
    note("keep " + in_folder(args.directory, "fleet.key") + " off the nodes: it decides who is a member");
    if (nodes.empty()) {
        note("next: create the key of a node there (cles keys new car1), carry car1.pub here, and run: cles fleet add "
             "car1.pub --may RIGHT --keys " +
             args.directory);
        return;
    }
    create_nodes(args.directory, nodes);
    note("next: let each node on this host use its folder; on another host, let the node create its own key");
}

void add_init(CLI::App& fleet, context& shared) {
    auto args = std::make_shared<fleet_arguments>();
    auto* command = fleet.add_subcommand("init", "Create a fleet");
    command
        ->add_option("directory", args->directory, "The authority's directory, which is created if it does not exist")
        ->required()
        ->type_name("DIR");
    command->add_option("--with", args->with, "Also create these nodes, each in a folder in it: for nodes on this host")
        ->type_name("NAME[,NAME...]");
    command->footer("Prints the folders that it has created.\n\n"
                    "Examples:\n"
                    "  cles fleet init ~/fleet\n"
                    "  cles fleet init /tmp/fleet --with car1,car2,sat1");
    run_with_keys(*command, shared, args, init);
}

// --- add ---

// Rights are never given by leaving an option out.
void require_may(const rights_options& rights) {
    if (!rights.has_may()) {
        throw usage_error("what may it request? Give --may RIGHT, which may be repeated, as in --may "
                          "'pull,bind *:localization'; or --may none; or, for everything, --may all");
    }
}

void add_nodes(const fleet_arguments& args) {
    args.rights.check();
    require_may(args.rights);
    const auto directory = args.keys.directory();
    std::vector<std::string> lines;
    for (const auto& file : args.files) {
        lines.push_back(read_carried_file(file));
        naming_file(file, [&] { return security::name_in_public_line(lines.back()); });
    }
    security::member_rights rights;
    args.rights.apply_to(rights);
    for (const auto& file : security::add_members(directory, lines, rights)) {
        write_output(printable(file) + "\n");
    }
    note("version " + std::to_string(security::describe_fleet(directory).version) + " of the roster is in " +
         directory);
    // A file that was exchanged on its way is only found by this.
    for (const auto& line : lines) {
        const auto name = security::name_in_public_line(line);
        auto text = name;
        text.append(" has the fingerprint ").append(security::fingerprint_in_public_line(line));
        text.append(": compare it with that of 'cles keys show' at ").append(name);
        note(text.append("; if it differs, run: cles fleet remove ").append(name));
    }
    note("next: carry each NAME.join to the node NAME, and run there: cles keys join NAME.join");
}

void add_add(CLI::App& fleet, context& shared) {
    auto args = std::make_shared<fleet_arguments>();
    auto* command = fleet.add_subcommand("add", "Add nodes to the fleet");
    command->add_option("files", args->files, "NAME.pub of each node, as 'cles keys new' wrote it; - is stdin")
        ->required()
        ->type_name("FILE");
    args->rights.add_to(*command);
    args->keys.add_to(*command, authority_help);
    command->footer(
        "--may is required: a right, 'all' or 'none'. Without --offers, nodes may offer everything; without\n"
        "--forwards, they forward for no other node. Prints the path of the file that is carried to each node, and\n"
        "the fingerprint of its name and key, which has to be the one that 'cles keys show' prints there.\n\n"
        "Examples:\n"
        "  cles fleet add car1.pub car2.pub --may all\n"
        "  cles fleet add sat1.pub --may 'pull,bind *:localization' --offers none --forwards 'car*'");
    run_with_keys(*command, shared, args, add_nodes);
}

// --- rights ---

void change_rights(const fleet_arguments& args) {
    if (!args.rights.is_any_given()) {
        throw usage_error("give the rights that change: --may, --offers or --forwards; 'cles fleet show' shows them");
    }
    args.rights.check();
    const auto directory = args.keys.directory();
    const auto now = security::change_rights(directory, args.names.front(),
                                             [&](security::member_rights& rights) { args.rights.apply_to(rights); });
    write_output(rights_lines(now));
    note_new_roster(directory);
}

void add_rights(CLI::App& fleet, context& shared) {
    auto args = std::make_shared<fleet_arguments>();
    auto* command = fleet.add_subcommand("rights", "Change what a member is permitted");
    command->add_option("name", args->names, "The member")->required()->expected(1)->type_name("MEMBER");
    args->rights.add_to(*command);
    args->keys.add_to(*command, authority_help);
    command->footer(
        "Each option replaces the whole list of its kind, and may be repeated; the others stay as they are.\n\n"
        "Examples:\n"
        "  cles fleet rights car1 --may 'pull,bind *:*/**' --may 'push car2:target'\n"
        "  cles fleet rights car1 --may all --forwards none");
    run_with_keys(*command, shared, args, change_rights);
}

// --- remove, rotate ---

void add_remove(CLI::App& fleet, context& shared) {
    auto args = std::make_shared<fleet_arguments>();
    auto* command = fleet.add_subcommand("remove", "Remove members, and replace the group keys that they know");
    command->add_option("names", args->names, "The members")->required()->type_name("MEMBER");
    args->keys.add_to(*command, authority_help);
    command->footer("A node that returns, or gets a new key, is added again.\n\n"
                    "Examples:\n"
                    "  cles fleet remove car1");
    run_with_keys(*command, shared, args, [](const fleet_arguments& given) {
        const auto directory = given.keys.directory();
        security::remove_members(directory, given.names);
        note_new_roster(directory);
    });
}

void add_rotate(CLI::App& fleet, context& shared) {
    auto args = std::make_shared<fleet_arguments>();
    auto* command = fleet.add_subcommand("rotate", "Make the next group key the current one");
    args->keys.add_to(*command, authority_help);
    command->footer("Nodes that do not have the new roster yet can still be understood, until the next rotation.\n\n"
                    "Examples:\n"
                    "  cles fleet rotate");
    run_with_keys(*command, shared, args, [](const fleet_arguments& given) {
        const auto directory = given.keys.directory();
        security::rotate_group_keys(directory);
        note_new_roster(directory);
    });
}

} // namespace

void add_fleet(CLI::App& app, context& shared) {
    auto* fleet = app.add_subcommand("fleet", "Decide which nodes are members of a fleet, and what they may do");
    fleet->require_subcommand(1);
    fleet->footer("Examples:\n"
                  "  cles fleet init ~/fleet         # once, at the authority\n"
                  "  export CLES_KEYS=~/fleet\n"
                  "  cles fleet add car1.pub --may all\n"
                  "  cles fleet show");
    add_init(*fleet, shared);
    add_add(*fleet, shared);
    add_rights(*fleet, shared);
    add_remove(*fleet, shared);
    add_rotate(*fleet, shared);
    add_fleet_show(*fleet, shared);
}

} // namespace tool
