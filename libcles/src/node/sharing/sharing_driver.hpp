// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/local_node.hpp"
#include "node/sharing/work_sharing.hpp"

#include <memory>

namespace cles::core {

/// Lets a node share the jobs of a queue; see `cles::share_jobs`.
[[nodiscard]] std::unique_ptr<job_sharing> make_sharing(local_node& host, shareable_queue& jobs);

} // namespace cles::core
