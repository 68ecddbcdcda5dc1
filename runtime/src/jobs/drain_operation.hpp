// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "jobs/job_pool.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/steady_timer.hpp>

#include <chrono>
#include <functional>
#include <optional>
#include <utility>

namespace cles::runtime {

/// Waits for the last jobs of a pool: completes once, with the last job or at the limit.
class drain_operation {
  public:
    explicit drain_operation(const boost::asio::any_io_executor& executor) : limit_(std::in_place, executor) {}

    /// \param on_limit called unless `complete` or `cancel` was called before
    void begin(std::chrono::milliseconds limit, std::function<void()> on_limit,
               std::function<void(const drain_report&)> done);
    [[nodiscard]] bool is_pending() const noexcept { return done_ != nullptr; }
    void complete(const drain_report& report);
    /// Completes without a call, and refers to nothing of the executor any more.
    void cancel();

  private:
    std::optional<boost::asio::steady_timer> limit_;
    std::function<void(const drain_report&)> done_;
};

} // namespace cles::runtime
