// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

namespace cles::detail {

/// `cles::secured`. Null in a program that does not link cles::tls: the link options of that library name the function,
/// so that programs contain it although this reference does not ask for it.
[[gnu::weak]] service_part linked_security(const char* directory);

} // namespace cles::detail
