// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/support/descriptor.hpp"

#include <functional>
#include <thread>

namespace cles::perf {

/// The thread of a relay, which waits for its sockets by `poll`.
class relay_thread {
  public:
    /// The work has to return once something can be read from the descriptor that it receives.
    explicit relay_thread(std::function<void(int stop)> work);
    relay_thread(const relay_thread&) = delete;
    relay_thread& operator=(const relay_thread&) = delete;
    /// Waits for the work to return.
    ~relay_thread();

  private:
    descriptor stop_here_;
    descriptor stop_;
    std::thread thread_;
};

} // namespace cles::perf
