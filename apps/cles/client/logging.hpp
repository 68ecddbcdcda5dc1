// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

namespace tool {

// The library's log goes to stderr, in colour if that is a terminal and NO_COLOR is not set.

/// A client logs nothing by default, because failures are reported anyway; with -v from level info, with -vv
/// everything, and each line that is sent or received.
cles::log_sink make_client_log(int verbosity);

/// A server logs from level info, with -v everything, and with -vv each line too.
cles::log_sink make_server_log(int verbosity);

} // namespace tool
