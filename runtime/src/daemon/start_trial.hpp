// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

namespace cles::runtime {

struct config;

/// Does what a daemon with this configuration does first, by the same functions, and undoes it: reads the files of its
/// security and its federation, listens at each URL, and joins the multicast group. Other nodes do not notice. If the
/// daemon runs already, the URLs at which it listens are left out. \param log receives what the daemon would log
/// meanwhile \returns whether the daemon runs already \throws config_error, cles::error as the daemon's start
bool try_start(const config& setup, const log_sink& log);

} // namespace cles::runtime
