// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "node/node_state.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

// -- failures that refuse requests ---------------------------------------------------------------------------------

[[gnu::cold]] protocol::failure busy(std::string message);
/// The memory limit is reached, of the node or of this peer.
[[gnu::cold]] protocol::failure no_memory(const node_state& n);
[[gnu::cold]] protocol::failure no_such_task(const node_state& n, const protocol::request_line& request);
/// A line over the limit. `datagram`: the maximum size of one, 0 for a stream.
[[gnu::cold]] protocol::failure overlong(const node_state& n, std::size_t datagram);
/// `busy` if the node runs as many handlers as it may, else nothing.
std::optional<protocol::failure> no_capacity_to_run(const node_state& n);
/// The failure once the handler has run: codes after which the request might be repeated say so, since that would
/// repeat its effect. (`busy` is the handler's own promise that it has done nothing.)
[[gnu::cold]] protocol::failure after_run(protocol::failure why);

using protocol::failure_text;

// -- checks before a request is served -----------------------------------------------------------------------------

/// Whether `name` is in the comma-separated list `via`.
bool is_in_via(std::string_view via, std::string_view name);

/// Whose rights apply to a request: those of the requester that a forwarder states, if the peer may forward for it;
/// else the peer's. Empty if it is no member, and without security.
std::string_view requester_of(const node_state& n, const identity& peer, const protocol::request_line& request);

/// The member of a secured fleet that is meant: "car1" of "north.car1", which is a node of another pool.
std::string_view member_of(const node_state& n, std::string_view target);

/// Whether `requester` may send `provider` a request for this noun. True without security. For `any` and `all` of
/// another pool, the rights are checked there, for each node.
bool permits(const node_state& n, std::string_view requester, std::string_view provider, verb how,
             const protocol::noun_view& noun);
/// The same for a path of `provider`, such as that of a topic.
bool permits(const node_state& n, std::string_view requester, std::string_view provider, verb how,
             std::string_view path);

/// Whether this node may forward for the requester; itself, and without security, for all.
bool may_forward_for(const node_state& n, std::string_view requester);
/// That this node lacks that right: "car1 may not forward requests of sat1 to car2 (...)".
[[gnu::cold]] std::string may_not_forward(const node_state& n, std::string_view requester, std::string_view target);
/// How to permit that a node forwards for another one: "(cles fleet rights car1 --forwards sat1)".
[[gnu::cold]] std::string how_to_permit_forwarding(std::string_view forwarder, std::string_view requester);

/// Whether the access rules allow the request.
bool allows(const node_state& n, const identity& peer, const protocol::request_line& request);

/// Whether the target is this node, by name or as `self`.
bool is_local_target(const node_state& n, const protocol::request_line& request);

/// Why a node does not serve a request, whatever its task: access, target or body. Nothing if it may.
std::optional<protocol::failure> refusal_reason(const node_state& n, const identity& peer,
                                                const protocol::request_line& request);

/// The reply of a node that shuts down to new requests.
[[gnu::cold]] protocol::failure shutting_down(const node_state& n);

/// Appends the reply to a link beyond the limit, and its LF.
[[gnu::cold]] void append_link_refusal(std::string& out, const node_state& n, std::uint64_t id = 0);

/// The id in "cles/cancel/<id>"; nothing for other nouns or an invalid id.
std::optional<std::uint64_t> cancelled_id(const protocol::noun_view& noun);

} // namespace cles::core
