// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/json_writer.hpp>

#include "node/node_state.hpp"
#include "node/session/reply_writer.hpp"
#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

namespace cles::core {

/// Writes `tasks` of the reply to `PULL self:cles`.
void write_tasks(json_writer& w, const node_state& n);
/// Writes the reply to `PULL self:cles`.
void write_description(json_writer& w, const node_state& n);
/// Writes the reply to `PULL self:cles/metrics`.
void write_metrics(json_writer& w, const node_state& n);

/// Serves a request for the reserved task `cles`, except cancellations (docs/protocol.md, "The reserved task").
void serve_reserved(node_state& host, reply_writer& replies, const protocol::request_line& request,
                    const identity& peer);

} // namespace cles::core
