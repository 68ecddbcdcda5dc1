// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <memory>

namespace cles::shell {
class local_node;
} // namespace cles::shell

namespace cles::detail {

/// A service's routing, as the rest of the service sees it.
class routing_host {
  public:
    routing_host() = default;
    routing_host(const routing_host&) = delete;
    routing_host& operator=(const routing_host&) = delete;
    virtual ~routing_host() = default;

    /// Who is there is still being asked: `any` and `all` wait.
    virtual void hold() = 0;
    /// The nodes that are to be found have been.
    virtual void release(time_point now) = 0;
    /// Begins what has become ready, and passes updates on that have come since the last time: in a turn, since
    /// handlers run.
    virtual void go_on(time_point now) = 0;
    virtual void stop() = 0;
};

/// How it is made for a service, which has its node ask it from then on.
struct routing_part {
    std::unique_ptr<routing_host> (*make)(shell::local_node& host);
};

} // namespace cles::detail
