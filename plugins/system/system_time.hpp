// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

namespace sysinfo {

/// The paper's example (section 3.3): PULL and DELEGATE `systemTime` and `systemTime/UTC` return
/// `{"systemTime":"2026-11-21T20:13:36.123456789Z"}` (RFC 3339).
void register_system_time(cles::registrar& to);

} // namespace sysinfo
