// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/limits.hpp>

#include "node/session/call.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <memory>

namespace cles::core {
class local_node;
} // namespace cles::core

namespace cles::detail {

/// The routing of a service, as seen by the rest of the service: an interface, so that a program that does not route
/// does not link it.
class routing_service {
  public:
    routing_service() = default;
    routing_service(const routing_service&) = delete;
    routing_service& operator=(const routing_service&) = delete;
    virtual ~routing_service() = default;

    /// `any` and `all` wait, because discovery is still in progress.
    virtual void hold() = 0;
    /// Discovery is over.
    virtual void release() = 0;
    /// Starts the requests that are ready. Call it in a turn, since handlers run.
    virtual void run_ready(time_point now) = 0;
    virtual void stop() = 0;
};

/// Creates the routing of a service, which its node uses from then on.
struct routing_part {
    std::unique_ptr<routing_service> (*make)(core::local_node& host);
};

} // namespace cles::detail

namespace cles::core {

class relayed_bindings;
class relays;

/// Creates the calls for the requests of a link: `inbound`, on which routing and publishing do not depend.
class call_factory {
  public:
    call_factory() = default;
    call_factory(const call_factory&) = delete;
    call_factory& operator=(const call_factory&) = delete;
    /// A call for a request that is answered later. Null if there are too many; the request has then been refused.
    virtual std::shared_ptr<call> make_call(const protocol::request_line& request, time_point due, time_point now) = 0;

  protected:
    ~call_factory() = default;
};

/// Serves a node's requests for `any`, `all` and other nodes (docs/protocol.md, "Routing"). They have been checked: the
/// client is authorised, this node is not in `via`, and the body is valid. An interface, so that a program that does
/// not route does not link it.
class router {
  public:
    router() = default;
    router(const router&) = delete;
    router& operator=(const router&) = delete;

    /// Has a request answered, through a call that it makes. Returns false if this node itself is to serve it, in line.
    /// `peer` is valid until the call has ended.
    virtual bool route(const protocol::request_line& request, const identity& peer, time_point due, time_point now,
                       call_factory& from) = 0;
    /// This node was to serve a request in line but was `busy`, so it has not started: continues with another node.
    virtual void continue_after_busy(const protocol::request_line& request, const identity& peer,
                                     const protocol::failure& why, time_point due, time_point now,
                                     call_factory& from) = 0;
    /// Like `route`, for BIND. `place` contains the bindings of the link's peer, and lives as long as the call.
    virtual void bind(const protocol::request_line& request, relayed_bindings& place, time_point due, time_point now,
                      call_factory& from) = 0;
    /// The source of the relayed bindings.
    virtual std::shared_ptr<relays> relayed() = 0;

  protected:
    ~router() = default;
};

} // namespace cles::core
