// SPDX-License-Identifier: BSL-1.0
#include "client/member_key.hpp"

#include "output/errors.hpp"

#ifdef CLES_SECURITY

#include <cles/error.hpp>
#include <cles/security.hpp>
#include <cles/security/core_dumps.hpp>
#include <cles/security/local_user.hpp>
#include <cles/security/node_files.hpp>

#include <stdexcept>
#include <utility>

namespace tool {

void use_member_key(cles::service_options& options, const std::string& directory,
                    const std::vector<std::pair<std::string, std::string>>& local_users) {
    cles::security::forbid_core_dumps();
    cles::security_options from{.directory = directory};
    for (const auto& [user, member] : local_users) {
        const auto id = cles::security::id_of_user(user);
        std::string said = "--local-user '";
        said.append(user).append("=").append(member).append("': ");
        if (!id) {
            throw usage_error(said.append("there is no user '").append(user).append("'"));
        }
        if (const auto [at, is_new] = from.local_users.emplace(*id, member); !is_new && at->second != member) {
            throw usage_error(said.append("that user is ").append(at->second).append(" already"));
        }
    }
    try {
        options.security = cles::secured(std::move(from));
    } catch (const cles::error& e) { // of this host, not of a node
        throw std::runtime_error(e.message());
    }
    options.name = name_of_member(directory);
}

std::string name_of_member(const std::string& directory) {
    cles::security::forbid_core_dumps(); // describing a node reads its key
    return cles::security::describe_node(directory).name;
}

} // namespace tool

#else

namespace tool {
namespace {

[[noreturn]] void refuse(const std::string& directory) {
    throw usage_error("--keys " + directory + ": this program was built without security");
}

} // namespace

void use_member_key(cles::service_options& /*options*/, const std::string& directory,
                    const std::vector<std::pair<std::string, std::string>>& /*local_users*/) {
    refuse(directory);
}

std::string name_of_member(const std::string& directory) { refuse(directory); }

} // namespace tool

#endif

namespace tool {

cles::service_options options_of_member(const std::string& name, const std::string& directory) {
    cles::service_options out;
    if (directory.empty()) {
        out.name = name;
    } else {
        use_member_key(out, directory);
    }
    return out;
}

} // namespace tool
