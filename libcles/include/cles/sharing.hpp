// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

/// Moves jobs that wait in a program's queue to other nodes, and those of other nodes to this one (docs/sharing.md).
/// For programs with a queue and workers of their own, such as `clesd`.

namespace cles {

class service;

namespace core {
class call;
} // namespace core

/// Takes jobs from a queue, on behalf of a node that has granted slots for them.
class job_taker {
  public:
    job_taker() = default;
    job_taker(const job_taker&) = delete;
    job_taker& operator=(const job_taker&) = delete;

    /// Whether no more jobs are wanted.
    [[nodiscard]] virtual bool full() const noexcept = 0;
    /// Whether it takes that job. May be called while the queue is locked. \param ahead how many jobs start before it
    /// \param service_time how long a job of its task holds a worker here; 0: not known
    [[nodiscard]] virtual bool choose(const core::call& job, std::size_t ahead,
                                      std::chrono::microseconds service_time) = 0;
    /// Sends a chosen job, which the queue has removed, to the node. Its outcome is passed to the requester.
    /// \param ended called once, not inside this call: `true` if the node has refused the job before it began, so that
    /// it has to be put back into the queue, at its old place; `false` if it has been answered
    /// \return identifies the job for `job_sharing::withdraw`
    virtual std::uint64_t take(std::shared_ptr<core::call> job, std::string_view body,
                               std::function<void(bool refused)> ended) = 0;

  protected:
    ~job_taker() = default;
};

/// The queue of a program, as sharing sees it. All functions are called on the service's executor.
class shareable_queue {
  public:
    struct state {
        std::uint32_t waiting = 0;                 ///< jobs that have not started
        std::uint32_t idle = 0;                    ///< workers that will take some of them at once
        std::uint32_t workers = 0;                 ///< that are not stuck
        std::chrono::microseconds service_time{0}; ///< how long a job has lately held a worker; 0: not known
        std::uint32_t movable = 0;                 ///< of the waiting jobs, those that `job_sharing::may_move`
        std::uint64_t movable_queued = 0;          ///< how many such jobs have been queued so far
        bool draining = false;                     ///< no more jobs are accepted

        /// Workers for jobs of other nodes: those for which no job waits.
        [[nodiscard]] std::uint32_t free() const noexcept { return draining || idle < waiting ? 0 : idle - waiting; }
        /// Jobs for other nodes: those for which there is no worker, if they may move.
        [[nodiscard]] std::uint32_t excess() const noexcept {
            return std::min(movable, waiting > idle ? waiting - idle : 0);
        }
    };

    shareable_queue() = default;
    shareable_queue(const shareable_queue&) = delete;
    shareable_queue& operator=(const shareable_queue&) = delete;

    [[nodiscard]] virtual state read_state() const = 0;
    /// Offers jobs to `to` that have not started and may move, in the order in which they will start, and passes to it
    /// those that it chooses. It may end early, so that the queue is not locked for long.
    virtual void offer(job_taker& to) = 0;

  protected:
    ~shareable_queue() = default;
};

/// The part that a service takes in sharing, until it is destroyed.
class job_sharing {
  public:
    job_sharing() = default;
    job_sharing(const job_sharing&) = delete;
    job_sharing& operator=(const job_sharing&) = delete;
    virtual ~job_sharing() = default;

    /// Whether a job may move to another node; known before it is queued.
    [[nodiscard]] virtual bool may_move(const core::call& job) const noexcept = 0;
    /// Jobs have been added to the queue, or a worker has become free.
    virtual void on_change() = 0;
    /// The requester of a job that was taken no longer waits: cancels it. `ended` is not called any more.
    virtual void withdraw(std::uint64_t ticket) = 0;
};

/// Lets a service share the jobs of a queue. The service has to route (`cles::routing`), so that it knows which tasks
/// others offer. Both have to outlive the result. On the service's executor.
[[nodiscard]] std::unique_ptr<job_sharing> share_jobs(service& by, shareable_queue& jobs);

} // namespace cles
