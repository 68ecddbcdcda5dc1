// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/completion_queue.hpp"
#include "port/environment.hpp"

#include <cstddef>
#include <deque>
#include <memory>

namespace cles::core {

/// Calls completions as tasks of the environment, in order and never from inside `put`. One task calls those that wait
/// and those that they put, up to `max_at_once` in all, so that what several of them publish or request is written
/// together.
///
/// While any waits, a further task is always posted. So an exception from one leaves the environment's loop and the
/// others are still called, and one that runs that loop itself gets the others called. If the environment is destroyed
/// before the task runs, the completions are destroyed too: they may own the owner of the queue.
class completion_drain final : public task, public std::enable_shared_from_this<completion_drain> {
  public:
    static constexpr std::size_t max_at_once = 8;

    explicit completion_drain(std::shared_ptr<environment> by) : environment_(std::move(by)) {}

    void put(completion due);
    void run() override;
    [[gnu::cold]] void discard() noexcept override;

  private:
    void post();

    std::shared_ptr<environment> environment_;
    std::deque<completion> due_;
    bool is_posted_ = false;
};

} // namespace cles::core
