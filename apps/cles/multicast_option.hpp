// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

namespace CLI {
class App;
}

namespace tool {

/// Programs take part on loopback unless something else is said.
inline cles::multicast_options default_multicast() { return {.interface = "lo"}; }

/// --multicast, and CLES_MULTICAST in the environment.
void add_multicast_option(CLI::App& command, cles::multicast_options& where);

} // namespace tool
