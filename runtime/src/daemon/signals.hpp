// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/signal_set.hpp>

#include <functional>

namespace cles::runtime {

/// What the daemon is told by signals: SIGTERM and SIGINT to stop, SIGHUP to read its configuration again.
class signals {
  public:
    /// The functions run on the executor, as often as the signals come.
    signals(const boost::asio::any_io_executor& executor, std::function<void(int)> on_stop,
            std::function<void()> on_reload);

    /// Listens no more, so that the executor may run out of work.
    void close();

  private:
    void wait();

    boost::asio::signal_set set_;
    std::function<void(int)> on_stop_;
    std::function<void()> on_reload_;
};

} // namespace cles::runtime
