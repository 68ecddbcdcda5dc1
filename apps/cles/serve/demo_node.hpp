// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include <boost/asio/steady_timer.hpp>

#include <chrono>

namespace tool {

/// Makes a service a node to experiment with: a moving vehicle that publishes its position, and the tasks of
/// demo_tasks.hpp.
class demo_node {
  public:
    /// `rate`: publications of the localization per second; 0: it can only be pulled.
    demo_node(cles::service& by, double rate);

    /// Publishes no more.
    void stop();

  private:
    void register_localization();
    void publish();

    cles::service& service_;
    boost::asio::steady_timer timer_;
    std::chrono::nanoseconds period_{0};
    std::chrono::steady_clock::time_point next_;
    bool stopped_ = false;
};

} // namespace tool
