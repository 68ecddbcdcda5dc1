// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/thread_pool.hpp>

#include <chrono>
#include <cstddef>
#include <memory>

namespace cles::runtime {

/// Threads that run what is posted to their `asio::thread_pool`, to which each attaches itself; so that one can be
/// added at any time, and one that never comes back can be left behind, which a thread pool's own threads cannot.
class worker_threads {
  public:
    explicit worker_threads(std::size_t count);
    worker_threads(const worker_threads&) = delete;
    worker_threads& operator=(const worker_threads&) = delete;
    ~worker_threads();

    /// \throws std::system_error where the system has no more threads to give
    void add();
    [[nodiscard]] std::size_t count() const noexcept;
    [[nodiscard]] boost::asio::thread_pool::executor_type get_executor() const noexcept;

    /// Runs nothing more, and waits so long for what runs, of which `busy` may take longer than that. Returns how many
    /// threads still run something; they are left to themselves, with what they need. Not from one of them.
    std::size_t stop(std::chrono::milliseconds limit, std::size_t busy = 0);

  private:
    struct inside;
    std::shared_ptr<inside> inside_;
};

} // namespace cles::runtime
