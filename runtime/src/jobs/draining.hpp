// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/steady_timer.hpp>

#include <chrono>
#include <functional>
#include <optional>

namespace cles::runtime {

struct drain_report;

/// The wait for the last jobs of a pool: it ends once, by the last job or by the limit.
class draining {
  public:
    explicit draining(const boost::asio::any_io_executor& executor) : limit_(std::in_place, executor) {}

    /// \param at_limit called unless `end` or `forget` was before
    void begin(std::chrono::milliseconds limit, std::function<void()> at_limit,
               std::function<void(const drain_report&)> done);
    [[nodiscard]] bool under_way() const noexcept { return done_ != nullptr; }
    void end(const drain_report& how);
    /// Nobody waits any more; nothing of the executor is held from here on.
    void forget();

  private:
    std::optional<boost::asio::steady_timer> limit_;
    std::function<void(const drain_report&)> done_;
};

} // namespace cles::runtime
