// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/limits.hpp>

#include "core/call.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <memory>

namespace cles::core {

class relayed_bindings;
class relays;

/// What serves the requests of a link, as a router sees it.
class call_opener {
  public:
    call_opener() = default;
    call_opener(const call_opener&) = delete;
    call_opener& operator=(const call_opener&) = delete;
    /// A call for a request that is answered later. Null where there are too many; then it has been refused.
    virtual std::shared_ptr<call> open_call(const protocol::request_line& request, time_point due, time_point now) = 0;

  protected:
    ~call_opener() = default;
};

/// Where a node has its clients' requests for `any`, `all` and other nodes (docs/protocol.md, "Routing"). They have
/// been checked: who asks may ask for it, this node is not in `via`, the body is valid.
class router {
  public:
    router() = default;
    router(const router&) = delete;
    router& operator=(const router&) = delete;

    /// Has a request answered, through a call that it opens. False where this node itself is to serve it, in line.
    /// `peer` lives as long as the call has not ended.
    virtual bool route(const protocol::request_line& request, const identity& peer, time_point due, time_point now,
                       call_opener& from) = 0;
    /// This node was to serve a request in line, and was `busy`, so that it has not begun: has another one asked.
    virtual void go_on(const protocol::request_line& request, const identity& peer, const protocol::failure& why,
                       time_point due, time_point now, call_opener& from) = 0;
    /// As `route`, for BIND. What the peer of the link is bound to stands in `place`, which lives as long as the call.
    virtual void bind(const protocol::request_line& request, relayed_bindings& place, time_point due, time_point now,
                      call_opener& from) = 0;
    /// Where what is bound comes from.
    virtual std::shared_ptr<relays> relayed() = 0;

  protected:
    ~router() = default;
};

} // namespace cles::core
