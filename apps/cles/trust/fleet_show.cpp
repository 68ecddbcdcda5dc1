// SPDX-License-Identifier: BSL-1.0
#include "trust/fleet_show.hpp"

#include <cles/json_writer.hpp>
#include <cles/security/fleet_files.hpp>

#include "commands.hpp"
#include "options/keys_option.hpp"
#include "output/errors.hpp"
#include "output/printer.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"
#include "trust/rights_options.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace tool {

namespace security = cles::security;

namespace {

struct show_arguments {
    keys_option keys;
    output_format format = output_format::automatic;
};

std::string fleet_text(const security::fleet_description& fleet) {
    std::string out = "fleet      " + fleet.fleet + "\nroster     version " + std::to_string(fleet.version) +
                      "\ngroup key  generation " + std::to_string(fleet.generation) + ", accepted from " +
                      std::to_string(fleet.oldest) + " on\n";
    if (fleet.members.empty()) {
        return out + "no members\n";
    }
    table members{"NUMBER", "NAME", "MAY", "OFFERS", "FORWARDS"};
    for (const auto& member : fleet.members) {
        members.row();
        members.set(0, std::to_string(member.number), true);
        members.set(1, printable(member.name));
        members.set(2, rights_text(member.rights.may));
        members.set(3, rights_text(member.rights.offers));
        members.set(4, rights_text(member.rights.forwards));
    }
    return out + "\n" + members.text();
}

void write_number(cles::json_writer& w, std::string_view key, std::uint64_t value) {
    w.key(key);
    w.value(value);
}

std::string fleet_json(const security::fleet_description& fleet) {
    std::string out;
    cles::json_writer w{out};
    w.begin_object();
    w.key("fleet");
    w.value(std::string_view{fleet.fleet});
    write_number(w, "version", fleet.version);
    write_number(w, "generation", fleet.generation);
    write_number(w, "oldest", fleet.oldest);
    w.key("members");
    w.begin_array();
    for (const auto& member : fleet.members) {
        w.begin_object();
        write_number(w, "number", member.number);
        w.key("name");
        w.value(std::string_view{member.name});
        w.key("key");
        w.value(std::string_view{member.key});
        write_rights(w, member.rights);
        w.end_object();
    }
    w.end_array();
    w.end_object();
    return out;
}

void show(const show_arguments& args) {
    const auto fleet = security::describe_fleet(args.keys.directory());
    if (resolved(args.format) == output_format::table) {
        write_output(fleet_text(fleet));
    } else if (args.format == output_format::raw) {
        write_output(fleet.line + "\n");
    } else {
        printer{args.format, false}.print(fleet_json(fleet));
    }
    for (const auto& warning : fleet.warnings) {
        note(warning);
    }
}

} // namespace

void add_fleet_show(CLI::App& fleet, context& shared) {
    auto args = std::make_shared<show_arguments>();
    auto* command = fleet.add_subcommand("show", "Show the members of the fleet, and what they are permitted");
    args->keys.add_to(*command, "A directory with a roster: the authority's, or a node's");
    add_output_option(*command, args->format);
    command->footer(
        "Needs no private key. In JSON, a missing 'may' or 'offers' means everything; raw is the roster itself.\n\n"
        "Examples:\n"
        "  cles fleet show\n"
        "  cles fleet show -o json | jq -r '.members[].name'");
    command->callback([args, &shared] {
        show(*args);
        shared.exit_code = exit_code::success;
    });
}

} // namespace tool
