// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "jobs/adaptive_mutex.hpp"

#include <atomic>
#include <functional>

namespace cles::runtime {

/// The `on_stop` callback of one job, and whether the job has been stopped. May be used from any thread.
class stop_callback {
  public:
    [[nodiscard]] bool stopped() const noexcept { return stopped_.load(std::memory_order_acquire); }
    /// Keeps the callback, which replaces an earlier one; or calls it at once if the job has been stopped.
    void set(std::function<void()> callback);
    /// The job is stopped. Returns the callback, to be called on a thread where it may take long.
    std::function<void()> stop();
    /// The job has answered, and is not told to stop any more. Destroys the callback on this thread.
    void drop();
    /// For another job.
    void reset();

  private:
    std::atomic<bool> stopped_{false};
    std::atomic<bool> is_set_{false};
    adaptive_mutex mutex_; // of the callback
    std::function<void()> callback_;
};

} // namespace cles::runtime
