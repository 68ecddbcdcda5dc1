// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>

#include <utility>

namespace cles::asio_port {

/// A timer by the clock of all deadlines, which goes on while the machine is suspended: what was due meanwhile is due
/// as soon as the machine wakes. (Asio's own timers wait by a clock that stands still then, and would be as late as the
/// machine slept.)
class boottime_timer {
  public:
    /// \throws cles::error where the system has no timer to give
    explicit boottime_timer(const boost::asio::any_io_executor& executor);

    /// From now on it is due then, whether somebody waits or not.
    void set(time_point due);
    /// Whether it has been due; asked for once each time.
    [[nodiscard]] bool take();
    /// `handler(error_code)` is called when it may be due; `take` says whether it was.
    template <class Handler>
    void async_wait(Handler&& handler) {
        timer_.async_wait(boost::asio::posix::descriptor_base::wait_read, std::forward<Handler>(handler));
    }
    void cancel();

  private:
    boost::asio::posix::stream_descriptor timer_;
};

} // namespace cles::asio_port
