// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/laboratory_fleet.hpp"

#ifdef CLES_SECURITY

#include <cles/security/core_dumps.hpp>
#include <cles/security/fleet_files.hpp>
#include <cles/security/member_names.hpp>
#include <cles/security/node_files.hpp>

#include "platoon/simulation/simulation.hpp"

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <vector>

namespace platoon {
namespace {

namespace security = cles::security;
using rights = std::vector<std::string>;

// Members find each other by BIND `cles`.
const security::member_rights of_vehicle{
    .may = rights{"bind *:cles", "bind *:state", "push *:join"},
    .offers = rights{"bind *:cles", "bind *:state", "push *:join", "push *:leave", "push *:split"}};
const security::member_rights of_operator{.may = rights{"bind *:cles", "bind *:state", "push *:leave", "push *:split"},
                                          .offers = rights{}};

std::string temporary_folder() {
    auto path = (std::filesystem::temp_directory_path() / "cles-platoon-XXXXXX").string();
    if (::mkdtemp(path.data()) == nullptr) { // with the mode 0700
        throw std::system_error(errno, std::generic_category(), "a folder for keys, " + path);
    }
    return path;
}

void remove(const std::string& folder) {
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
}

void create_members(const std::string& folder, std::size_t vehicles) {
    const auto directory_of = [&folder](const std::string& name) { return security::member_folder(folder, name); };
    std::vector<std::string> names{operator_name};
    std::vector<std::string> lines;
    for (std::size_t i = 0; i < vehicles; ++i) {
        names.push_back(name_of(i));
        lines.push_back(security::create_node_key(directory_of(names.back()), names.back()).line);
    }
    security::create_fleet(folder);
    security::add_members(folder, lines, of_vehicle);
    security::add_members(folder, {security::create_node_key(directory_of(operator_name), operator_name).line},
                          of_operator);
    const auto roster = security::describe_fleet(folder).line;
    for (const auto& name : names) {
        security::join_fleet(directory_of(name), roster);
    }
}

} // namespace

laboratory_fleet::laboratory_fleet(std::size_t vehicles) : folder_(temporary_folder()) {
    try {
        security::forbid_core_dumps();
        create_members(folder_, vehicles);
    } catch (...) {
        remove(folder_);
        throw;
    }
}

laboratory_fleet::~laboratory_fleet() { remove(folder_); }

} // namespace platoon

#else

#include "output/errors.hpp"

namespace platoon {

laboratory_fleet::laboratory_fleet(std::size_t /*vehicles*/) {
    throw tool::usage_error("--secured: this program was built without security");
}

laboratory_fleet::~laboratory_fleet() = default;

} // namespace platoon

#endif
