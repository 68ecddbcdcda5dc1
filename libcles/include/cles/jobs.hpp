// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <functional>
#include <optional>

namespace cles {

class responder;

namespace detail {
struct jobs_part;
} // namespace detail

/// Returns a value for `service_options::jobs`, which makes the service list its jobs (`PULL self:cles/jobs`), cancel
/// one on request, and tell how long the handlers of each task take (docs/protocol.md, "Jobs"). Only programs that call
/// this function link its code.
const detail::jobs_part* jobs() noexcept;

/// What only a pool of workers knows of a job.
struct job_status {
    bool waiting = false;             ///< it has not started: it waits for a worker
    std::optional<double> progress{}; ///< the fraction that its handler has last reported
};

/// For pools of workers: has the service of this job call `status` when somebody lists the jobs, on the service's
/// executor, until the last copy of the responder is destroyed. It must neither throw nor block, nor end or start a
/// job. Without `service_options::jobs`, and in a plugin, it is never called.
void tell_job_status(const responder& job, std::function<job_status()> status);

} // namespace cles
