// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

namespace tool {

// The library's words go to stderr, in colour where that is a terminal and NO_COLOR is not set.

/// A client tells nothing unless asked (-v: what happens, -vv: everything), since failures are reported anyway.
cles::log_sink log_of_client(int verbosity);

/// A server says what happens, and everything with -v.
cles::log_sink log_of_server(int verbosity);

} // namespace tool
