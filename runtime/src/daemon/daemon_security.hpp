// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <memory>

namespace cles::detail {
class security_part;
}

namespace cles::runtime {

struct config;

/// The security that the configuration asks for; null if it is off. \throws config_error if its files cannot be used, a
/// user is unknown, or this program was built without security
std::shared_ptr<detail::security_part> security_of(const config& setup);

} // namespace cles::runtime
