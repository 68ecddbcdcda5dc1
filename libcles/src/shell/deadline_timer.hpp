// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/absence.hpp"
#include "core/clock.hpp"
#include "core/deadlines.hpp"
#include "shell/boottime_timer.hpp"

#include <boost/asio/any_io_executor.hpp>

#include <functional>
#include <memory>
#include <optional>

namespace cles::shell {

/// The one timer that serves all deadlines of a service. It is set anew only when an earlier deadline comes, so that
/// requests which end in time cost it nothing.
class deadline_timer : public std::enable_shared_from_this<deadline_timer> {
  public:
    /// `due` is called when the earliest deadline has come, and told whether the process was stopped meanwhile. The
    /// clock stays until `stop`.
    deadline_timer(const boost::asio::any_io_executor& executor, const core::clock& time,
                   std::function<void(bool)> due);

    void follow(const core::deadline_queue& deadlines);
    void stop();

  private:
    void wait();

    boottime_timer timer_;
    const core::clock& time_;
    std::function<void(bool)> due_;
    core::absence absence_;
    std::optional<time_point> set_for_;
    bool waiting_ = false;
};

} // namespace cles::shell
