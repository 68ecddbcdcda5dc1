// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/limits.hpp>

#include "port/request_origin.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <memory>

namespace cles::core {

class inbound;
class local_node;
class relayed_bindings;
class relays;
class service_registry;

/// The routing of a node. Serves its requests for `any`, `all` and other nodes (docs/protocol.md, "Routing"). They have
/// been checked: the client is authorised, this node is not in `via`, and the body is valid. An interface, so that a
/// program that does not route does not link it.
class router {
  public:
    router() = default;
    router(const router&) = delete;
    router& operator=(const router&) = delete;
    virtual ~router() = default;

    /// Has a request answered, through a call that `from` makes. Returns false if this node itself is to serve it, in
    /// line. `peer` is valid until the call has ended.
    virtual bool route(const protocol::request_line& request, const identity& peer, time_point due, time_point now,
                       inbound& from) = 0;
    /// This node was to serve a request in line but was `busy`, so it has not started: continues with another node.
    virtual void continue_after_busy(const protocol::request_line& request, const identity& peer,
                                     const protocol::failure& why, time_point due, time_point now, inbound& from) = 0;
    /// Like `route`, for BIND of that origin. `place` contains the bindings of the link's peer, and lives as long as
    /// the call.
    virtual void bind(const protocol::request_line& request, const request_origin& by, relayed_bindings& place,
                      time_point due, time_point now, inbound& from) = 0;
    /// The source of the relayed bindings.
    virtual std::shared_ptr<relays> relayed() = 0;

    /// The other nodes and their tasks.
    [[nodiscard]] virtual const service_registry& registry() const = 0;

    /// `any` and `all` wait, because discovery is still in progress.
    virtual void hold() = 0;
    /// Discovery is over. `expects_nodes`: except that seeds may still answer, for which requests wait that no known
    /// node serves.
    virtual void release(bool expects_nodes) = 0;
    /// Members may do more than before: what they may bind now is bound.
    virtual void on_rights_changed() = 0;
    /// Starts the requests that are ready. Call it in a turn, since handlers of this node run.
    virtual void begin_ready(time_point now) = 0;
    /// Sends no more requests.
    virtual void stop() = 0;
};

} // namespace cles::core

namespace cles::detail {

/// Creates the routing of a service, which its node uses from then on.
struct routing_part {
    std::shared_ptr<core::router> (*make)(core::local_node& host);
};

} // namespace cles::detail
