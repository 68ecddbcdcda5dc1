// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/thread_pool.hpp>

#include <chrono>
#include <cstddef>
#include <memory>

namespace cles::runtime {

/// Threads that attach themselves to an `asio::thread_pool`, and run what is posted to it. Unlike the thread pool's own
/// threads, further ones can be added at any time, and one that does not return can be abandoned.
class worker_threads {
  public:
    explicit worker_threads(std::size_t count);
    worker_threads(const worker_threads&) = delete;
    worker_threads& operator=(const worker_threads&) = delete;
    ~worker_threads();

    /// \throws std::system_error if the system has no more threads
    void add();
    [[nodiscard]] std::size_t count() const noexcept;
    [[nodiscard]] boost::asio::thread_pool::executor_type get_executor() const noexcept;

    /// Starts nothing more, and waits up to the limit for the running functions, of which `busy` may take longer.
    /// Returns how many threads still run something; they are abandoned, with everything they need. Not to be called by
    /// one of them.
    std::size_t stop(std::chrono::milliseconds limit, std::size_t busy = 0);

  private:
    struct state;
    std::shared_ptr<state> state_;
};

} // namespace cles::runtime
