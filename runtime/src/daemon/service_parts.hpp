// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include <string>

namespace cles::runtime {

struct config;

// The parts of the service that this program may have been built without.

/// The security that the configuration asks for; empty if it is off. \throws config_error if its files cannot be used,
/// the key is that of another node, a user is unknown, or this program was built without security
detail::service_part security_of(const config& setup);

/// The name of the key in this directory; empty if it cannot be read.
std::string name_of_key(const std::string& directory);

/// The bridge that the configuration asks for; empty if it is off. \throws config_error if this program was built
/// without federation
detail::service_part federation_of(const config& setup);

} // namespace cles::runtime
