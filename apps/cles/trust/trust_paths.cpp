// SPDX-License-Identifier: BSL-1.0
#include "trust/trust_paths.hpp"

#include <cles/security/member_names.hpp>

#include <filesystem>
#include <system_error>

namespace tool {

void check_node_name(const std::string& name) {
    if (const auto flaw = cles::security::flaw_of_member_name(name); !flaw.empty()) {
        throw usage_error(flaw);
    }
}

std::string in_folder(const std::string& directory, const std::string& name) {
    return directory + (directory.ends_with('/') ? "" : "/") + name;
}

void create_parents(const std::string& directory) {
    // "keys/" is the same folder as "keys".
    const auto parent = std::filesystem::path{directory.substr(0, directory.find_last_not_of('/') + 1)}.parent_path();
    if (parent.empty()) {
        return;
    }
    std::error_code code;
    std::filesystem::create_directories(parent, code);
    if (code) {
        throw std::runtime_error("cannot create the folder " + parent.string() + ": " + code.message());
    }
}

} // namespace tool
