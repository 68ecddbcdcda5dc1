// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>
#include <cles/log.hpp>

#include <string>

namespace tool {

/// Logs every line that is sent or received on a link from now on, with the address of the other end:
/// "> tcp://127.0.0.1:25370 PULL car1:localization id=1". Call it before creating a service.
void log_wire(const cles::log_sink& log);

/// Wraps one link so that its lines are logged.
cles::link_ptr logged(cles::link_ptr inner, std::string address, cles::log_sink log);

} // namespace tool
