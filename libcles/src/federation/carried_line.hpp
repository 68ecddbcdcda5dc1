// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include "protocol/request_line.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

/// Lines as they cross NATS (docs/protocol.md, "Federation"): verb, node and task of a request or update are in the
/// subject, the rest is the message.

namespace cles::bridging {

/// The message for a request, after its task: " deadline=900 via=south.hub {...}", or "/fast deadline=900 ...".
/// \param home the pool that the nodes in `via` belong to; empty: they remain as they are
/// \param deadline_ms instead of the request's; 0: that one
std::string message_of(const protocol::request_line& request, std::string_view home, std::uint32_t deadline_ms = 0);
/// The same within the own pool: without `via`, because the request may lead to nodes that have forwarded it to the
/// bridge, or to the bridge itself.
std::string message_within_pool(const protocol::request_line& request, std::uint32_t deadline_ms = 0);

/// The line of a request that has arrived, without LF, with that id, and with `via_of`.
std::string line_of(const protocol::request_line& request, std::uint64_t id, std::string_view from);

/// `via` of a request that has arrived: begins with an entry for the pool that it is from, so that no bridge of this
/// pool sends it on to another one. \param from empty: a program that is no bridge
std::string via_of(const protocol::request_line& request, std::string_view from);
/// Whether the request has arrived from NATS in this pool, at whatever bridge.
bool has_crossed(std::string_view via) noexcept;

/// The text of a request or update that has arrived: "PULL car1:speed/fast deadline=900". `node` may be another name
/// for the node.
std::string text_of(verb how, std::string_view node, std::string_view task, std::string_view message);

/// "car1:localization/fast"
std::string noun_of(const protocol::request_line& request);

/// Whether the request has been in that pool.
bool has_passed(std::string_view via, std::string_view pool) noexcept;

/// "id=7 {...}" to "{...}"; nothing if it has no id.
struct reply_parts {
    std::uint64_t id = 0;
    std::string_view rest;
    bool is_interim = false; ///< progress
};
reply_parts split_reply(std::string_view line) noexcept;
/// The other way round.
std::string reply_line(std::uint64_t id, std::string_view rest);

/// "taken=0b1c2d3e4f5a6b7c", which precedes a reply, or is an acknowledgement. Removes it from `message`.
std::string_view take_taker(std::string_view& message) noexcept;
std::string taken_text(std::string_view instance);

/// Lines of bridges to each other.
inline constexpr std::string_view lost_line = "PUSH self:cles/lost";
inline constexpr std::string_view names_line = "PULL self:cles/names";
/// Of a bridge that leaves, to itself: what the server has sent before is received.
inline constexpr std::string_view drained_line = "PUSH self:cles/drained";
/// Of a bridge, or between bridge and node.
std::string cancel_line(std::uint64_t number);
/// The number that is cancelled, 0 if it cannot be one; nothing: the request cancels nothing.
std::optional<std::uint64_t> cancelled_number(const protocol::request_line& request) noexcept;
/// To the bridge that has sent the BIND of that number: what it has bound is over.
std::string unbound_line(std::uint64_t number);
/// That number, as of `cancelled_number`.
std::optional<std::uint64_t> unbound_number(const protocol::request_line& request) noexcept;

} // namespace cles::bridging
