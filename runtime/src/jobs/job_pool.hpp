// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>
#include <cles/peer.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>
#include <cles/service.hpp>

#include "jobs/job_context.hpp"

#include <boost/describe/class.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

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

/// A request that is to be served by a worker.
struct job {
    const cles::request& what;            ///< copied by `job_pool::submit`
    responder answer;                     ///< used on the service's executor only
    std::shared_ptr<const job_work> work; ///< shared by all jobs of the task, so that none has to copy it
};

class pool_state;

/// How a drain ended.
struct drain_report {
    std::size_t refused = 0;   ///< jobs that had not begun and were answered `busy`
    std::size_t abandoned = 0; ///< jobs that had begun and were answered `unavailable`
    std::size_t stuck = 0;     ///< of these, how many still hold a worker
};

/// Runs the jobs of a service on workers.
///
/// A job is admitted into a bounded queue or answered `busy`, with how long the queue will take as `retry_ms`. The
/// links that ask take turns: who has many jobs waiting makes nobody else wait behind them. A job that is withdrawn,
/// whose link is lost or whose time is over is taken out of the queue, or told to stop where it runs. One that does not
/// stop then is stuck: it is reported and its worker replaced, as often as there are replacements.
///
/// All functions are to be called on the service's executor, and the pool goes before its service. At its end, jobs
/// that have not answered are answered `unavailable`. Threads that are still in a job or an `on_stop` callback after
/// `pool_options::patience` are left to themselves: such a program has to end by `std::_Exit` or `std::quick_exit`,
/// since there is no way to end a thread that does not want to.
class job_pool {
  public:
    job_pool(service& host, pool_options options);
    job_pool(const job_pool&) = delete;
    job_pool& operator=(const job_pool&) = delete;
    ~job_pool();

    void submit(job what);

    /// For announcements and `any:`. Costs next to nothing.
    [[nodiscard]] node_load load() const noexcept;
    [[nodiscard]] pool_figures figures() const;

    /// Admits no more, and calls back when all jobs have ended. At the limit it answers what is left, tells what runs
    /// to stop, and calls back; the destructor then waits for no job, `close` as long as it is told. To be called once.
    void drain(std::chrono::milliseconds limit, std::function<void(const drain_report&)> done);

    /// What the destructor does, with another limit than `pool_options::patience`: answers what is left, and waits
    /// that long in all for the workers and for `on_stop` callbacks, and a second at most for what is about to end.
    /// Returns how many threads are left behind; 0 if the pool has been closed before.
    std::size_t close(std::chrono::milliseconds limit);

    /// For `pooled_registrar`, whose handlers may be called after the pool has gone.
    [[nodiscard]] const std::shared_ptr<pool_state>& state() const noexcept { return state_; }

  private:
    std::shared_ptr<pool_state> state_;
};

} // namespace cles::runtime
