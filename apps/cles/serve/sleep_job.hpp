// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/request.hpp>
#include <cles/responder.hpp>

#include <boost/asio/steady_timer.hpp>

#include <chrono>
#include <memory>

namespace tool {

/// DELEGATE sleep/<ms>: a task that takes its time, tells how far it is, and can be stopped.
class sleep_job : public std::enable_shared_from_this<sleep_job> {
  public:
    /// \throws cles::error with `bad_request` where the parameter is no time
    static void start(const cles::request& request, cles::responder answer);

    sleep_job(std::chrono::milliseconds span, cles::responder answer);

  private:
    void sleep_a_tenth();

    std::chrono::milliseconds span_;
    cles::responder answer_;
    boost::asio::steady_timer timer_;
    std::chrono::steady_clock::time_point begun_;
    int tenths_ = 0;
};

} // namespace tool
