// SPDX-License-Identifier: BSL-1.0
#include "daemon/service_parts.hpp"

#include <cles/error.hpp>
#include <cles/federation.hpp>

#include "config/config.hpp"

#ifdef CLES_WITH_SECURITY
#include <cles/security.hpp>
#include <cles/security/core_dumps.hpp>
#include <cles/security/local_user.hpp>
#include <cles/security/node_files.hpp>

#include <exception>
#include <string>
#endif

namespace cles::runtime {

#ifdef CLES_WITH_SECURITY

detail::service_part security_of(const config& setup) {
    if (!setup.security.is_on()) {
        return {};
    }
    security::forbid_core_dumps();
    security_options options{.directory = setup.security.keys};
    for (const auto& [user, member] : setup.security.local_users) {
        const auto where = setup.location_of("security.local_users." + user);
        const auto id = security::id_of_user(user);
        if (!id) {
            throw config_error(where, "there is no user '" + user + "'");
        }
        // By its name and by its id.
        if (const auto [at, is_new] = options.local_users.emplace(*id, member); !is_new && at->second != member) {
            throw config_error(where, "that user is " + at->second + " already");
        }
    }
    try {
        auto made = secured(std::move(options));
        if (const auto name = name_of_key(setup.security.keys); name != setup.node) {
            throw config_error(setup.location_of("node"), "'" + setup.node + "' is not the name of the key in " +
                                                              setup.security.keys + ", which is '" + name +
                                                              "'; without 'node', the node has that name");
        }
        return made;
    } catch (const error& e) {
        throw config_error(setup.location_of("security"), e.message());
    }
}

std::string name_of_key(const std::string& directory) {
    try {
        security::forbid_core_dumps();
        return security::describe_node(directory).name;
    } catch (const std::exception&) { // reported when the security is made
        return {};
    }
}

#else

detail::service_part security_of(const config& setup) {
    if (setup.security.is_on()) {
        throw config_error(setup.location_of("security"), "this clesd was built without security");
    }
    return {};
}

std::string name_of_key(const std::string& /*directory*/) { return {}; }

#endif

detail::service_part federation_of(const config& setup) {
    const auto& wanted = setup.federation;
    if (!wanted.is_on()) {
        return nullptr;
    }
#ifdef CLES_WITH_FEDERATION
    try {
        return federation({.servers = wanted.servers,
                           .pool = wanted.pool,
                           .credentials = wanted.credentials,
                           .token = wanted.token,
                           .tls_authority = wanted.tls_authority,
                           .tls_certificate = wanted.tls_certificate,
                           .tls_key = wanted.tls_key});
    } catch (const error& e) {
        throw config_error(setup.location_of("federation"), e.message());
    }
#else
    throw config_error(setup.location_of("federation"), "this clesd was built without federation");
#endif
}

} // namespace cles::runtime
