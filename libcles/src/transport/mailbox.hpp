// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/post.hpp>

#include <mutex>
#include <utility>

namespace cles::transport {

/// The way to something that lives on an executor of its own, for those who may outlive that executor.
///
/// Its owner shuts it before the executor's context goes; from then on nothing is posted any more. Used by any thread.
class mailbox {
  public:
    explicit mailbox(boost::asio::any_io_executor executor) : executor_(std::move(executor)) {}

    /// Runs `action` on the executor, later; drops it where the mailbox is shut.
    template <class F>
    void post(F action) {
        const std::lock_guard lock{mutex_};
        if (executor_) {
            boost::asio::post(executor_, std::move(action));
        }
    }

    void shut() {
        const std::lock_guard lock{mutex_};
        executor_ = nullptr;
    }

  private:
    std::mutex mutex_;
    boost::asio::any_io_executor executor_;
};

} // namespace cles::transport
