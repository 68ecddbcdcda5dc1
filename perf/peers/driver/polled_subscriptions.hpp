// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "inbox.hpp"
#include "ordered_fan_out.hpp"

#include <chrono>
#include <cstddef>
#include <vector>

#include <poll.h>

namespace cles::perf::peers {

/// A connection for each subscription; one thread waits for all, and reads from those that are readable.
class polled_subscriptions : public subscriptions {
  public:
    void take_for(std::chrono::milliseconds at_most, inbox& into) final;

  protected:
    void wait_for_socket(int socket) { sockets_.push_back({.fd = socket, .events = POLLIN, .revents = 0}); }

  private:
    /// \param number of the subscription, in the order of `wait_for_socket`
    virtual void read(std::size_t number, inbox& into) = 0;

    std::vector<pollfd> sockets_;
};

} // namespace cles::perf::peers
