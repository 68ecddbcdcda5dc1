// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>

#include <utility>

namespace cles::asio_port {

/// A timer on the clock of all deadlines, which continues while the machine is suspended: what became due meanwhile is
/// due as soon as the machine wakes. (Asio's own timers use a clock that stops then, and would be late by the whole
/// suspension.)
class boottime_timer {
  public:
    /// \throws cles::error if the system has no timer to give
    explicit boottime_timer(const boost::asio::any_io_executor& executor);

    /// Sets the time at which it is due, whether anything waits or not.
    void set(time_point due);
    /// Whether it has been due since the last call.
    [[nodiscard]] bool take();
    /// `handler(error_code)` is called when it may be due; `take` returns whether it was.
    template <class Handler>
    void async_wait(Handler&& handler) {
        timer_.async_wait(boost::asio::posix::descriptor_base::wait_read, std::forward<Handler>(handler));
    }
    void cancel();

  private:
    boost::asio::posix::stream_descriptor timer_;
};

} // namespace cles::asio_port
