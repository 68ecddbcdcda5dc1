// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/any_io_executor.hpp>

#include <atomic>
#include <memory>

#include <sys/types.h>
#include <unistd.h>

namespace cles::asio_port {

/// The process that an execution context belongs to: the one that made it, or a child of it that goes on in its place
/// and calls `notify_fork`, as Asio demands. Any other child has the sockets in common with its parent, and must not
/// end what the parent uses.
class owning_process {
  public:
    /// Whether it is this process.
    [[nodiscard]] bool is_this() const noexcept { return id_.load(std::memory_order_relaxed) == ::getpid(); }
    void become_this() noexcept { id_.store(::getpid(), std::memory_order_relaxed); }

    [[nodiscard]] static std::shared_ptr<const owning_process> of(const boost::asio::any_io_executor& executor);

  private:
    std::atomic<::pid_t> id_ = ::getpid();
};

} // namespace cles::asio_port
