// SPDX-License-Identifier: BSL-1.0
#include <cles/security/node_files.hpp>

#include "security/access/local_rules.hpp"
#include "security/fleet/group_keys.hpp"
#include "security/fleet/key_directory.hpp"
#include "security/fleet/member_file.hpp"

namespace cles::security {
namespace {

// Why a roster does not contain this node; empty if it does.
std::string reason_not_in(const roster& read, const node_identity& own) {
    const auto of_version = "version " + std::to_string(read.version()) + " of the roster";
    if (const auto* const same_key = read.find(own.key.public_part())) {
        return same_key->name == own.name
                   ? std::string{}
                   : of_version + " has the key of " + own.name + " under the name " + same_key->name;
    }
    return of_version +
           (read.find(own.name) != nullptr ? " has another key of " + own.name : " does not contain " + own.name);
}

node_description describe(const key_directory& files, const node_identity& own) {
    node_description out{
        .name = own.name, .key = to_base64url(own.key.public_part()), .fingerprint = fingerprint_of(own.public_part())};
    if (const auto newest = files.read_newest_roster(out.warnings)) {
        out.fleet = to_base64url(newest->fleet());
        out.version = newest->version();
        out.reason = reason_not_in(*newest, own);
        if (out.reason.empty()) {
            out.rights = newest->find(own.name)->rights();
        }
    } else {
        out.reason = "there is no roster";
    }
    const auto rules = read_local_rules(files.folder());
    out.rules = rules.rules().size();
    out.rules_error = rules.error();
    return out;
}

} // namespace

created_key create_node_key(const std::string& directory, const std::string& name) {
    require_member_name(name); // before the directory is created
    const auto files = key_directory::create(directory);
    if (files.has_key()) {
        throw security_error{files.folder().path_of("key") +
                             " already exists, and is never replaced: use another directory, or the key that is there"};
    }
    const auto made = files.create_key(name).public_part();
    return {.file = files.folder().path_of(member_file(name, ".pub")),
            .line = to_line(made),
            .fingerprint = fingerprint_of(made)};
}

node_description describe_node(const std::string& directory) {
    const key_directory files{directory};
    return describe(files, files.read_key());
}

std::string write_certificate(const std::string& directory) {
    const key_directory files{directory};
    files.write_certificate(files.read_key().key);
    return files.certificate_path();
}

node_description join_fleet(const std::string& directory, std::string_view roster_line) {
    const key_directory files{directory};
    const auto own = files.read_key();
    const auto offered = roster::read(roster_line, roster::named_fleet(roster_line));
    if (const auto why = reason_not_in(*offered, own); !why.empty()) {
        throw security_error{why};
    }
    static_cast<void>(open_group_keys(offered->find(own.name)->group_keys, own.key)); // throws if they are not for it
    std::vector<std::string> warnings;
    const auto newest = files.read_newest_roster(warnings);
    if (newest && newest->fleet() != offered->fleet()) {
        throw security_error{"this roster is of another fleet than that in " + directory +
                             ": a node belongs to one fleet; to leave it, remove its 'roster' and '.join' files there"};
    }
    if (!files.store_roster(*offered)) {
        throw security_error{directory + " has a roster that is newer, or another one of the same version"};
    }
    return describe(files, own);
}

} // namespace cles::security
