// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/key_directory.hpp"

#include "protocol/grammar.hpp"
#include "security/fleet/member_file.hpp"
#include "security/keys/certificate.hpp"

#include <utility>

namespace cles::security {
namespace {

constexpr std::size_t max_key_file = 1024;
constexpr const char* key_file = "key";
constexpr const char* fleet_key_file = "fleet.key";
constexpr const char* certificate_file = "tls.pem";
constexpr const char* roster_file = "roster";
constexpr const char* roster_lock = ".roster.lock";

using file_access = protected_folder::access;

// Calls `read`; adds the path to its error.
template <class Read>
auto naming(const std::string& path, Read read) {
    try {
        return read();
    } catch (const security_error& e) {
        throw security_error{path + ": " + e.what()};
    }
}

std::string file_line(const roster& written) { return written.line() + "\n"; }

void require_listed(const node_identity& own, const roster& newest) {
    const auto version = "version " + std::to_string(newest.version()) + " of the roster";
    if (const auto* const listed = newest.find(own.key.public_part())) {
        if (listed->name != own.name) {
            throw security_error{own.name + "'s key is in " + version + " under the name " + listed->name +
                                 ": create a new key for " + own.name + ", or use the name " + listed->name};
        }
        return;
    }
    const auto adding = "run 'cles fleet add " + own.name + ".pub --may RIGHT' where the fleet's key is";
    if (newest.find(own.name) != nullptr) {
        throw security_error{version + " has another key for " + own.name + ": use that key, or remove " + own.name +
                             " from the fleet and " + adding};
    }
    throw security_error{own.name + "'s key is not in " + version + ": " + adding + ", and put the new " + own.name +
                         ".join into this directory"};
}

} // namespace

node_identity key_directory::create_key(const std::string& name) const {
    require_member_name(name);
    node_identity made{name, signing_key::generate()};
    // The private key comes first: while it exists, no other one is created.
    folder_.create_file(key_file, to_line(made).view(), file_access::secret);
    write_public_identity(made.public_part());
    return made;
}

void key_directory::write_public_identity(const public_identity& identity) const {
    folder_.replace_file(member_file(identity.name, ".pub"), as_bytes(to_line(identity)), file_access::readable);
}

bool key_directory::has_key() const { return folder_.read_secret(key_file, max_key_file).has_value(); }

node_identity key_directory::read_key() const {
    const auto content = folder_.read_secret(key_file, max_key_file);
    if (!content) {
        throw security_error{folder_.path_of(key_file) + " does not exist: 'cles keys new' creates it"};
    }
    return naming(folder_.path_of(key_file), [&] { return read_node_identity(content->view()); });
}

void key_directory::write_certificate(const signing_key& key) const {
    folder_.replace_file(certificate_file, to_pem(key).view(), file_access::secret);
}

std::string key_directory::certificate_path() const { return folder_.path_of(certificate_file); }

void key_directory::create_fleet_key(const signing_key& key) const {
    folder_.create_file(fleet_key_file, fleet_key_line(key).view(), file_access::secret);
}

signing_key key_directory::read_fleet_key() const {
    const auto content = folder_.read_secret(fleet_key_file, max_key_file);
    if (!content) {
        throw security_error{folder_.path_of(fleet_key_file) + " does not exist: 'cles fleet init' creates it"};
    }
    return naming(folder_.path_of(fleet_key_file), [&] { return security::read_fleet_key(content->view()); });
}

public_identity key_directory::read_public_identity(const std::string& name) const {
    const auto content = folder_.read_text(name, max_key_file);
    if (!content) {
        throw security_error{folder_.path_of(name) + " does not exist"};
    }
    return naming(folder_.path_of(name), [&] { return security::read_public_identity(*content); });
}

std::shared_ptr<const roster> key_directory::read_roster_file(const std::string& name, const roster* known) const {
    const auto content = folder_.read_text(name, max_roster_line + 1);
    if (!content) {
        return nullptr;
    }
    std::string_view line{*content};
    line.remove_suffix(line.ends_with('\n') ? 1 : 0);
    return naming(folder_.path_of(name), [&] { return roster::read(line, roster::named_fleet(line), known); });
}

std::shared_ptr<const roster> key_directory::read_newest_roster(std::vector<std::string>& warnings) const {
    auto names = folder_.names_ending(".join");
    names.insert(names.begin(), roster_file); // so that it counts if another one is as new
    std::shared_ptr<const roster> newest;
    std::string from;
    for (const auto& name : names) {
        auto read = read_roster_file(name, newest.get());
        if (!read) {
            continue;
        }
        if (newest && read->fleet() != newest->fleet()) {
            throw security_error{folder_.path_of(name) + " is of another fleet than " + folder_.path_of(from) +
                                 ": remove the wrong one, a node belongs to one fleet"};
        }
        if (newest && read->version() == newest->version() && read->content() != newest->content()) {
            warnings.push_back(folder_.path_of(name) + " differs from " + folder_.path_of(from) +
                               " and has the same version, so it is ignored; the next version ends the fork");
        }
        if (!newest || read->version() > newest->version()) {
            newest = std::move(read);
            from = name;
        }
    }
    return newest;
}

node_credentials key_directory::read_node() const {
    auto own = read_key();
    std::vector<std::string> warnings;
    auto newest = read_newest_roster(warnings);
    if (!newest) {
        throw security_error{folder_.path() + " contains no roster: put " + own.name +
                             ".join there, which 'cles fleet add " + own.name +
                             ".pub --may RIGHT' writes where the fleet's key is"};
    }
    naming(folder_.path(), [&] { require_listed(own, *newest); });
    return {std::move(own), std::move(newest), std::move(warnings)};
}

bool key_directory::store_roster(const roster& newest) const {
    const auto guard = folder_.lock(roster_lock);
    const auto stored = read_roster_file(roster_file, &newest);
    if (stored && stored->fleet() != newest.fleet()) {
        throw security_error{folder_.path_of(roster_file) + " is of another fleet"};
    }
    if (stored && stored->version() >= newest.version()) {
        return stored->content() == newest.content();
    }
    folder_.replace_file(roster_file, as_bytes(file_line(newest)), file_access::readable);
    return true;
}

void key_directory::write_join(const std::string& name, const roster& newest) const {
    folder_.replace_file(member_file(name, ".join"), as_bytes(file_line(newest)), file_access::readable);
}

} // namespace cles::security
