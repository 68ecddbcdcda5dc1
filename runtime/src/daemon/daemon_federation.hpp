// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

namespace cles::runtime {

struct config;

/// The bridge that the configuration asks for; empty if it is off. \throws config_error if this program was built
/// without federation
detail::service_part federation_of(const config& setup);

} // namespace cles::runtime
