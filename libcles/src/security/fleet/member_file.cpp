// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/member_file.hpp"

#include <cles/security/member_names.hpp>

#include "protocol/grammar.hpp"
#include "security/keys/identity.hpp"

#include <algorithm>
#include <array>

namespace cles::security {
namespace {

// What else such a directory contains. Rosters are looked for by their suffix.
constexpr std::array<std::string_view, 4> other_files{"key", "fleet.key", "roster", "rules"};
constexpr std::array<std::string_view, 2> other_suffixes{".pub", ".join"};

} // namespace

std::string flaw_of_member_name(std::string_view name) {
    if (auto flaw = flaw_of_node_name(name); !flaw.empty()) {
        return flaw;
    }
    // '.' and '..' are folders that exist, a name with '.' before it is not listed, and commands take '-' for an
    // option.
    if (name.starts_with('.') || name.starts_with('-')) {
        return protocol::quoted(name) + " cannot be the name of a member: it begins with '" + name.front() +
               "', and files get that name";
    }
    return {};
}

void require_member_name(std::string_view name) {
    if (const auto flaw = flaw_of_member_name(name); !flaw.empty()) {
        throw security_error{flaw};
    }
}

std::string member_file(std::string_view name, std::string_view suffix) {
    require_member_name(name);
    return std::string{name}.append(suffix);
}

std::string member_folder(const std::string& directory, std::string_view name) {
    const auto folder = member_file(name, "");
    if (std::ranges::find(other_files, name) != other_files.end() ||
        std::ranges::any_of(other_suffixes, [&](std::string_view each) { return name.ends_with(each); })) {
        throw security_error{protocol::quoted(name) + " cannot be the name of a folder in " + directory +
                             ", whose files have such names: create the key of that node in another folder"};
    }
    return directory + (directory.ends_with('/') ? "" : "/") + folder;
}

} // namespace cles::security
