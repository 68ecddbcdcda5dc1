// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>

namespace cles::runtime {

/// What a pool of workers has done since its start, and what it does now.
struct pool_figures {
    std::uint64_t admitted = 0;        ///< jobs that were queued
    std::uint64_t refused = 0;         ///< with `busy`: the queue was full, or the pool drains
    std::uint64_t withdrawn = 0;       ///< taken out of the queue before they began
    std::uint64_t answered = 0;        ///< ended with a result or a failure of their own
    std::uint64_t threw = 0;           ///< whose handler threw
    std::uint64_t answerless = 0;      ///< of these, because nobody was left who could have answered
    std::uint64_t answered_twice = 0;  ///< answers to a job that had one
    std::uint64_t logs_dropped = 0;    ///< too many at once
    std::uint64_t stuck = 0;           ///< jobs that did not end in time, so far
    std::uint64_t replaced = 0;        ///< of these, how many had their worker replaced
    std::uint64_t revived = 0;         ///< of these, how many ended after all
    std::uint64_t inline_calls = 0;    ///< handlers that ran on the I/O thread
    std::uint64_t inline_slow = 0;     ///< of these, how many took longer than they should
    std::uint64_t inline_worst_us = 0; ///< the longest of these

    std::uint32_t queued = 0;
    std::uint32_t running = 0;         ///< on workers
    std::uint32_t waiting = 0;         ///< begun, and on no worker: they wait for something
    std::uint32_t workers = 0;         ///< that can be used
    std::uint32_t stuck_now = 0;       ///< that cannot
    std::uint64_t service_time_us = 0; ///< how long a job holds a worker, smoothed
};
BOOST_DESCRIBE_STRUCT(pool_figures, (),
                      (admitted, refused, withdrawn, answered, threw, answerless, answered_twice, logs_dropped, stuck,
                       replaced, revived, inline_calls, inline_slow, inline_worst_us, queued, running, waiting, workers,
                       stuck_now, service_time_us))

} // namespace cles::runtime
