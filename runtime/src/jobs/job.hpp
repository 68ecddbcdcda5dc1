// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/request.hpp>
#include <cles/responder.hpp>

#include "jobs/job_context.hpp"

#include <cstdint>
#include <functional>
#include <memory>

namespace cles::runtime {

/// What the jobs of one task do. It runs on a worker, on several at once for several jobs, and answers through the
/// context, then or later. What it throws becomes the answer.
using job_work = std::function<void(const job_context&)>;

/// A request that is to be served by a worker.
struct job {
    const cles::request& what;            ///< copied by `job_pool::submit`
    responder answer;                     ///< used on the service's executor only
    std::shared_ptr<const job_work> work; ///< shared by all jobs of the task, so that none has to copy it
};

} // namespace cles::runtime
