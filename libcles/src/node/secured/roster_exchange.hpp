// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/limits.hpp>
#include <cles/pending.hpp>

#include "node/node_state.hpp"
#include "node/session/reply_writer.hpp"
#include "protocol/request_line.hpp"

#include <memory>
#include <string>
#include <string_view>

/// How rosters spread (docs/protocol_security.md, "The roster"): nodes state the version that they have, and those with
/// an older one ask for it.

namespace cles::core {

/// Whether the request states the version of the sender's roster.
bool is_hello(const protocol::request_line& request) noexcept;
/// The body of such a request.
std::string hello_body(const node_state& n);
/// Whether to ask that peer for the stated version now.
bool wants_stated_roster(const node_state& n, const identity& peer, const protocol::request_line& hello,
                         time_point now);

/// The reply to `PULL cles/roster`, which is offered to the node's security.
detail::pending_ptr make_roster_reply(std::shared_ptr<node_state> host, std::string from);

/// Serves a request for `cles/roster`.
void serve_roster(node_state& host, reply_writer& replies, const protocol::request_line& request);

} // namespace cles::core
