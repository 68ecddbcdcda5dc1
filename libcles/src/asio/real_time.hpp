// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <sched.h>

namespace cles::asio_port {

/// Puts the calling thread under SCHED_FIFO for as long as this lives. To be ended in the thread that made it.
class fifo_scheduling {
  public:
    /// \throws std::system_error where the system refuses
    explicit fifo_scheduling(int priority);
    fifo_scheduling(const fifo_scheduling&) = delete;
    fifo_scheduling& operator=(const fifo_scheduling&) = delete;
    ~fifo_scheduling();

  private:
    int policy_before_;
    sched_param parameters_before_{};
};

/// Locks all memory of the process, present and future.
/// \throws std::system_error where the system refuses
void lock_memory();

} // namespace cles::asio_port
