// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/deadlines.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/steady_timer.hpp>

#include <functional>
#include <memory>
#include <optional>

namespace cles::shell {

/// The one timer that serves all deadlines of a service. It is set anew only when an earlier deadline comes, so that
/// requests which end in time cost it nothing.
class deadline_timer : public std::enable_shared_from_this<deadline_timer> {
  public:
    /// `due` is called when the earliest deadline has come.
    deadline_timer(const boost::asio::any_io_executor& executor, std::function<void()> due);

    void follow(const core::deadline_queue& deadlines);
    void stop();

  private:
    boost::asio::steady_timer timer_;
    std::function<void()> due_;
    std::optional<time_point> set_for_;
};

} // namespace cles::shell
