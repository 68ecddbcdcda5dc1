// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/completion_queue.hpp"
#include "port/environment.hpp"

#include <cstddef>
#include <deque>
#include <memory>

namespace cles::core {

/// Calls completions as tasks of the environment, in order and never from inside `put`. Those that wait are called in
/// one task, and so are those that they put, up to `most_at_once` in all: what several of them publish or ask for is
/// then written together.
///
/// While any waits, a further task is always posted. So an exception from one leaves the environment's loop and the
/// others are called all the same, and one that runs that loop itself gets the others called. Where the environment is
/// destroyed before the task runs, the completions are destroyed too: they may own what owns the queue.
class completion_drain final : public task, public std::enable_shared_from_this<completion_drain> {
  public:
    static constexpr std::size_t most_at_once = 8;

    explicit completion_drain(std::shared_ptr<environment> by) : environment_(std::move(by)) {}

    void put(completion due);
    void run() override;
    void discard() noexcept override;

  private:
    void post();

    std::shared_ptr<environment> environment_;
    std::deque<completion> due_;
    bool is_posted_ = false;
};

} // namespace cles::core
