// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/laboratory_fleet.hpp"

#ifdef CLES_SECURITY

#include <cles/security/core_dumps.hpp>
#include <cles/security/fleet_files.hpp>
#include <cles/security/member_names.hpp>
#include <cles/security/node_files.hpp>

#include "platoon/simulation/simulation.hpp"

#include <string>
#include <vector>

namespace platoon {
namespace {

namespace security = cles::security;
using rights = std::vector<std::string>;

// Members find each other by BIND `cles`.
const security::member_rights of_vehicle{.may = rights{"bind *:cles", "bind *:state", "push *:join"},
                                         .offers = rights{"bind *:cles", "bind *:state", "bind *:localization",
                                                          "push *:join", "push *:leave", "push *:split"}};
const security::member_rights of_operator{.may = rights{"bind *:cles", "bind *:state", "push *:leave", "push *:split"},
                                          .offers = rights{}};

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

laboratory_fleet::laboratory_fleet(std::size_t vehicles) {
    security::forbid_core_dumps();
    create_members(folder(), vehicles);
}

} // namespace platoon

#else

#include "output/errors.hpp"

namespace platoon {

laboratory_fleet::laboratory_fleet(std::size_t /*vehicles*/) {
    throw tool::usage_error("--secured: this program was built without security");
}

} // namespace platoon

#endif
