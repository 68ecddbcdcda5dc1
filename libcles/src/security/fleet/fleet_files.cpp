// SPDX-License-Identifier: BSL-1.0
#include <cles/security/fleet_files.hpp>

#include "protocol/grammar.hpp"
#include "security/fleet/fleet_authority.hpp"
#include "security/fleet/key_directory.hpp"
#include "security/fleet/member_file.hpp"

#include <memory>
#include <utility>

namespace cles::security {
namespace {

std::shared_ptr<const roster> newest_in(const key_directory& files, std::vector<std::string>& warnings) {
    auto newest = files.read_newest_roster(warnings);
    if (!newest) {
        throw security_error{files.folder().path() +
                             " contains no roster: put the fleet's newest one there, which each "
                             "of its members has"};
    }
    return newest;
}

fleet_description describe(const roster& from) {
    fleet_description out{.fleet = to_base64url(from.fleet()),
                          .version = from.version(),
                          .generation = from.generation(),
                          .oldest = from.oldest(),
                          .line = from.line()};
    for (const auto& each : from.members()) {
        out.members.push_back({each.number, each.name, to_base64url(each.key), each.rights()});
    }
    return out;
}

/// The authority in its directory, for one change.
struct stored_authority {
    explicit stored_authority(const std::string& directory)
        : files(directory), authority(files.read_fleet_key(), newest_in(files, forks)) {}

    void store() const {
        if (!files.store_roster(authority.newest())) {
            throw security_error{"the fleet has been changed by another process at the same time: repeat the command"};
        }
    }

    key_directory files;
    std::vector<std::string> forks; // which the version that is made now ends
    fleet_authority authority;
};

} // namespace

fleet_description create_fleet(const std::string& directory) {
    const auto files = key_directory::create(directory);
    std::vector<std::string> warnings;
    if (files.read_newest_roster(warnings)) {
        throw security_error{directory + " already contains the roster of a fleet"};
    }
    if (files.folder().read_secret("fleet.key", 1024)) {
        throw security_error{files.folder().path_of("fleet.key") +
                             " already exists: put the fleet's newest roster there, or use another directory"};
    }
    auto key = signing_key::generate();
    files.create_fleet_key(key);
    const auto authority = fleet_authority::found(std::move(key));
    files.store_roster(authority.newest());
    return describe(authority.newest());
}

fleet_description describe_fleet(const std::string& directory) {
    const key_directory files{directory};
    std::vector<std::string> warnings;
    auto out = describe(*newest_in(files, warnings));
    out.warnings = std::move(warnings);
    return out;
}

std::string name_in_public_line(const std::string& line) { return read_public_identity(line).name; }

std::string fingerprint_in_public_line(const std::string& line) { return fingerprint_of(read_public_identity(line)); }

std::vector<std::string> add_members(const std::string& directory, const std::vector<std::string>& public_lines,
                                     const member_rights& rights) {
    std::vector<public_identity> nodes;
    nodes.reserve(public_lines.size());
    for (const auto& line : public_lines) {
        nodes.push_back(read_public_identity(line));
    }
    stored_authority stored{directory};
    stored.authority.add(nodes, rights);
    stored.store();
    std::vector<std::string> out;
    for (const auto& node : nodes) {
        stored.files.write_join(node.name, stored.authority.newest());
        out.push_back(stored.files.folder().path_of(member_file(node.name, ".join")));
    }
    return out;
}

member_rights change_rights(const std::string& directory, const std::string& name,
                            const std::function<void(member_rights&)>& change) {
    stored_authority stored{directory};
    const auto* const found = stored.authority.newest().find(name);
    if (found == nullptr) {
        throw security_error{protocol::quoted(name) + " is not a member of the fleet"};
    }
    auto rights = found->rights();
    change(rights);
    stored.authority.set_rights(name, rights);
    stored.store();
    return rights;
}

void remove_members(const std::string& directory, const std::vector<std::string>& names) {
    stored_authority stored{directory};
    stored.authority.remove(names);
    stored.store();
}

void rotate_group_keys(const std::string& directory) {
    stored_authority stored{directory};
    stored.authority.rotate();
    stored.store();
}

} // namespace cles::security
