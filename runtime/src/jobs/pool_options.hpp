// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

#include <chrono>
#include <cstddef>

namespace cles::runtime {

/// How a pool of workers is set up.
struct pool_options {
    unsigned workers = 0;      ///< threads; 0: as many as there are cores
    std::size_t queue = 1024;  ///< jobs that wait, before new ones are refused with `busy`
    unsigned replacements = 4; ///< workers that may take the place of stuck ones
    /// A job that still holds its worker so long after its deadline, or after its requester withdrew, is stuck.
    std::chrono::milliseconds grace{2'000};
    /// How long the destructor waits for workers that run a job, before it leaves them to themselves.
    std::chrono::milliseconds patience{2'000};
    /// How often the service's executor is to look in, also where there is no job. Where it is late by more than
    /// `late_executor`, the process was stopped, or the executor held up: no job begins then until what came meanwhile,
    /// withdrawals above all, has been read. 0: not watched, for an executor that does not run all the time.
    std::chrono::milliseconds look_in{0};
    std::chrono::milliseconds late_executor{250};
    /// A handler on the I/O thread (`inline_ok`) that takes longer is told of.
    std::chrono::microseconds slow_inline{5'000};
    log_sink log{}; ///< called on the service's executor
};

} // namespace cles::runtime
