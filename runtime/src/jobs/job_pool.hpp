// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/peer.hpp>
#include <cles/service.hpp>

#include "jobs/job.hpp"
#include "jobs/pool_figures.hpp"
#include "jobs/pool_options.hpp"

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>

namespace cles::runtime {

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
