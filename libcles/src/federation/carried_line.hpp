// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include "protocol/request_line.hpp"

#include <cstdint>
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

/// Whether the request has been in that pool.
bool has_passed(std::string_view via, std::string_view pool) noexcept;

/// "id=7 {...}" to "{...}"; nothing if it has no id.
struct reply_parts {
    std::uint64_t id = 0;
    std::string_view rest;
    bool is_interim = false; ///< progress
};
reply_parts split_reply(std::string_view line) noexcept;

} // namespace cles::bridging
