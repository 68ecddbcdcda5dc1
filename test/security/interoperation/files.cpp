// SPDX-License-Identifier: BSL-1.0
// Writes files of docs/protocol_security.md, or reads those of another implementation, for interoperation_test.py:
//
//   cles_security_files write FOLDER     a fleet: fleet.key, roster, and a folder for each of two nodes
//   cles_security_files read FOLDER      prints what a node's files contain, as JSON

#include <cles/json_writer.hpp>

#include "security/fleet/fleet_authority.hpp"
#include "security/fleet/group_keys.hpp"
#include "security/fleet/key_directory.hpp"
#include "security/hex.hpp"
#include "security/keys/signed_text.hpp"

#include <exception>
#include <iostream>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace cles::security;
using cles::security::test::to_hex;

void write_text_file(const key_directory& files, const std::string& name, std::string_view text) {
    files.folder().replace_file(name, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()},
                                protected_folder::access::readable);
}

// The signatures of car1 for one request and one update, each value on a line.
void write_signatures(const key_directory& files, const signing_key& key, const public_key& fleet) {
    const auto challenge = new_challenge();
    const signed_request request{.requester = "car1",
                                 .node = "car2",
                                 .challenge = challenge,
                                 .kind = cles::verb::push,
                                 .noun = "target/a%20b",
                                 .body = "{\"x\":1}",
                                 .waits_ms = 4900};
    const signed_update update{.publisher = "car1", .noun = "localization", .seq = 18, .epoch = "0000002a", .body = ""};
    write_text_file(files, "request", challenge + "\n" + sign(key, fleet, request) + ".4900\n");
    write_text_file(files, "update", sign(key, fleet, update) + "\n");
}

void write_fleet(const std::string& folder) {
    const auto files = key_directory::create(folder + "/authority");
    files.create_fleet_key(signing_key::generate());
    auto authority = fleet_authority::found(files.read_fleet_key());
    const auto car1_files = key_directory::create(folder + "/car1");
    const auto car2_files = key_directory::create(folder + "/car2");
    const auto car1 = car1_files.create_key("car1");
    const auto car2 = car2_files.create_key("car2");
    authority.add({"gone", signing_key::generate().public_part()});
    authority.add(car1_files.read_public_identity("car1.pub"));
    authority.remove("gone");
    authority.add(car2.public_part(), {.may = {{"pull,bind *:localization", "* \xc3\xa4\"\\:x/**"}},
                                       .offers = std::vector<std::string>{},
                                       .forwards = {"sat*"}});
    authority.rotate();
    files.store_roster(authority.newest());
    car1_files.write_join("car1", authority.newest());
    car2_files.store_roster(authority.newest());
    write_signatures(car1_files, car1.key, authority.newest().fleet());
}

void write_texts(cles::json_writer& out, std::string_view key, const std::vector<std::string>& texts) {
    out.key(key);
    out.begin_array();
    for (const auto& text : texts) {
        out.value(std::string_view{text});
    }
    out.end_array();
}

void print_node(const std::string& folder) {
    const auto node = key_directory{folder}.read_node();
    const auto& newest = *node.newest;
    std::string text;
    cles::json_writer out{text};
    const auto text_value = [&](std::string_view key, std::string_view value) {
        out.key(key);
        out.value(value);
    };
    const auto number = [&](std::string_view key, std::uint32_t value) {
        out.key(key);
        out.value(std::uint64_t{value});
    };
    const auto keys = open_group_keys(newest.find(node.own.name)->group_keys, node.own.key);
    out.begin_object();
    text_value("node", node.own.name);
    text_value("fleet", to_hex(newest.fleet()));
    number("version", newest.version());
    number("last", newest.last());
    number("generation", newest.generation());
    number("oldest", newest.oldest());
    text_value("current", to_hex(keys.current.view()));
    text_value("next", to_hex(keys.next.view()));
    out.key("members");
    out.begin_array();
    for (const auto& entry : newest.members()) {
        out.begin_object();
        number("number", entry.number);
        text_value("name", entry.name);
        text_value("key", to_hex(entry.key));
        text_value("agreement", to_hex(entry.agreement));
        if (entry.may) {
            write_texts(out, "may", *entry.may);
        }
        if (entry.offers) {
            write_texts(out, "offers", *entry.offers);
        }
        write_texts(out, "forwards", entry.forwards);
        out.end_object();
    }
    out.end_array();
    out.end_object();
    std::cout << text << "\n";
}

} // namespace

int main(int argc, char** argv) {
    const std::vector<std::string> arguments(argv + 1, argv + argc);
    try {
        if (arguments.size() == 2 && arguments[0] == "write") {
            write_fleet(arguments[1]);
        } else if (arguments.size() == 2 && arguments[0] == "read") {
            print_node(arguments[1]);
        } else {
            std::cerr << "usage: cles_security_files write|read FOLDER\n";
            return 2;
        }
    } catch (const std::exception& e) {
        std::cerr << e.what() << "\n";
        return 1;
    }
}
