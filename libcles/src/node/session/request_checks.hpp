// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "node/node_state.hpp"
#include "port/request_origin.hpp"
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

/// For messages: "PULL 'cles/metrics'". Rights are about the whole path, so its parameters belong to what is denied.
[[gnu::cold]] std::string request_text(verb how, std::string_view path);

// -- checks before a request is served -----------------------------------------------------------------------------

/// Whether `name` is in the comma-separated list `via`.
bool is_in_via(std::string_view via, std::string_view name);

/// `via` of a part of a request for `all`: it begins with that name, which no node has.
[[gnu::cold]] std::string via_of_part(std::string_view via);
/// Whether the request is a part of one for `all`, at the node that was asked or at another one. It is for this node
/// only: at another one, which has a part of its own, it would run twice.
bool is_part_of_all(const protocol::request_line& request);

/// Whose a request is: that of the member that it states with `from`, if the peer may forward for that one; the peer's
/// if it states none. Nobody's if the peer may not state that member, or is not authenticated itself; and without
/// security. Views of `n`, `peer` and `request`.
request_origin origin_of(const node_state& n, const identity& peer, const protocol::request_line& request);
/// The member whose rights apply to it.
inline std::string_view requester_of(const node_state& n, const identity& peer, const protocol::request_line& request) {
    return origin_of(n, peer, request).requester;
}

/// The member of a secured fleet that is meant: "car1" of "north.car1", which is a node of another pool.
std::string_view member_of(const node_state& n, std::string_view target);

/// Whether that one may send `provider` a request for this noun. True without security. For `any` and `all` of
/// another pool, the rights are checked there, for each node.
bool permits(const node_state& n, const request_origin& by, std::string_view provider, verb how,
             const protocol::noun_view& noun);
/// The same for a path of `provider`, such as that of a topic.
bool permits(const node_state& n, const request_origin& by, std::string_view provider, verb how, std::string_view path);

/// Whether a client's request may leave this node for another one.
enum class passage : std::uint8_t {
    permitted,
    not_permitted, ///< the requester may not send it to that node
    not_forwarded, ///< this node may not forward for the requester
};
/// Decides that for every way on which a request can leave: by name, as a part of `any` or `all`, a binding, a job that
/// moves, to another pool. Only a `forwarding_permit` (node/routing/next_hop.hpp), which asks this, lets one leave.
passage may_pass_on(const node_state& n, const request_origin& by, std::string_view node, verb how,
                    const protocol::noun_view& noun);
/// The same for a path of that node.
passage may_pass_on(const node_state& n, const request_origin& by, std::string_view node, verb how,
                    std::string_view path);
/// Why it may not leave: "car1 may not forward requests of sat1 to car2 (...)". Logs it as `log_denial` does.
[[gnu::cold]] protocol::failure no_passage(node_state& n, passage why, const request_origin& by, std::string_view node,
                                           verb how, std::string_view path);

/// Whether this node may forward for the requester; itself, and without security, for all.
bool may_forward_for(const node_state& n, std::string_view requester);
/// How to permit that a node forwards for another one: "(cles fleet rights car1 --forwards sat1)".
[[gnu::cold]] std::string how_to_permit_forwarding(std::string_view forwarder, std::string_view requester);

/// Whether the access rules allow the request.
bool allows(node_state& n, const identity& peer, const protocol::request_line& request);

/// Logs that a request was denied: who may not learns of it by the reply; who operates this node, by the log.
[[gnu::cold]] void log_denial(node_state& n, const identity& peer, const protocol::request_line& request,
                              std::string_view why);

/// Whether the target is this node, by name or as `self`.
bool is_local_target(const node_state& n, const protocol::request_line& request);

/// Why a node does not serve a request, whatever its task: access, target or body. Nothing if it may. What is denied is
/// logged.
std::optional<protocol::failure> refusal_reason(node_state& n, const identity& peer,
                                                const protocol::request_line& request);

/// Why no reader accepts the body of a reply or an update; empty if one does.
[[gnu::cold]] std::string why_unreadable(std::string_view body);

/// The reply of a node that shuts down to new requests.
[[gnu::cold]] protocol::failure shutting_down(const node_state& n);

/// Appends the reply to a link beyond the limit, and its LF.
[[gnu::cold]] void append_link_refusal(std::string& out, const node_state& n, std::uint64_t id = 0);

/// The id in "cles/cancel/<id>"; nothing for other nouns or an invalid id.
std::optional<std::uint64_t> cancelled_id(const protocol::noun_view& noun);

} // namespace cles::core
