// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/run.hpp>
#include <cles/service.hpp>

#include "child_process.hpp"

namespace cles::perf {

/// A node that publishes as it is told by a PUSH of a `fan_out_order` to its task "publish", for ever. The PUSH is
/// answered when all has been published. Paced, it publishes and goes on, as one does with what is measured anew soon;
/// otherwise as fast as the binders take it.
void serve_fan_out(service_options options, const run_options& how, const child_process::announce& announce);

} // namespace cles::perf
