// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

namespace tool {

// The library's words go to stderr, in colour where that is a terminal and NO_COLOR is not set.

/// A client logs nothing unless asked, since failures are reported anyway. -v: what happens. -vv: everything, and from
/// now on each line that is sent or received on links.
cles::log_sink log_of_client(int verbosity);

/// A server logs what happens, with -v everything, and with -vv the lines too.
cles::log_sink log_of_server(int verbosity);

} // namespace tool
