// SPDX-License-Identifier: BSL-1.0
#include "daemon/daemon_federation.hpp"

#include "config/config.hpp"

#ifdef CLES_WITH_FEDERATION

#include <cles/error.hpp>
#include <cles/federation.hpp>

namespace cles::runtime {

detail::service_part federation_of(const config& setup) {
    const auto& wanted = setup.federation;
    if (!wanted.is_on()) {
        return nullptr;
    }
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
}

} // namespace cles::runtime

#else

namespace cles::runtime {

detail::service_part federation_of(const config& setup) {
    if (setup.federation.is_on()) {
        throw config_error(setup.location_of("federation"), "this clesd was built without federation");
    }
    return nullptr;
}

} // namespace cles::runtime

#endif
