// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>
#include <cles/log.hpp>

#include <string>

namespace tool {

/// From now on every line that is sent or received on a link goes to the log, with the other end's address:
/// "> tcp://127.0.0.1:25370 PULL car1:localization id=1". To be called before any service is made.
void log_wire(const cles::log_sink& log);

/// The same of one link, which goes on in the one that is given back.
cles::link_ptr logged(cles::link_ptr inside, std::string where, cles::log_sink log);

} // namespace tool
