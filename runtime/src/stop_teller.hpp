// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "job_context.hpp"
#include "worker_threads.hpp"

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>

namespace cles::runtime {

/// Tells jobs that they are to stop, on a thread that does nothing else: neither the node nor a worker waits for what a
/// job does then. The thread is there from the first job on that wants to be told.
class stop_teller {
  public:
    stop_teller();
    stop_teller(const stop_teller&) = delete;
    stop_teller& operator=(const stop_teller&) = delete;
    ~stop_teller();

    void tell(job_context job, std::function<void()> callback);
    /// Waits so long until all have been told, half a second at least: who is being told in the moment when the limit
    /// passes is seldom one that hangs. Those that have not been told by then never are; nothing of them is held.
    /// Returns how many threads are left behind.
    std::size_t end(std::chrono::milliseconds limit);

  private:
    struct waiting;

    std::shared_ptr<waiting> waiting_; // the thread's too, which may be left behind
    std::unique_ptr<worker_threads> thread_;
};

} // namespace cles::runtime
