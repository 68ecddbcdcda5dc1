// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/run.hpp>

#include "config/config.hpp"
#include "perf/support/child_process.hpp"

#include <vector>

namespace cles::perf {

/// Runs a daemon, `car1`, with one plugin. Does not return. \param cores where its threads may run
void run_daemon(const runtime::plugin_config& plugin, unsigned workers, const std::vector<int>& cores,
                const run_options& how, const child_process::announce& announce);

} // namespace cles::perf
