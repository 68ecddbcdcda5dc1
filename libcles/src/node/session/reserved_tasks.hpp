// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/session/reply_writer.hpp"

namespace cles::core {

/// Writes `tasks` of the reply to `PULL self:cles`.
void write_tasks(json_writer& w, const node_state& n);
/// Writes the reply to `PULL self:cles`.
void write_description(json_writer& w, const node_state& n);
/// Writes the reply to `PULL self:cles/metrics`.
void write_metrics(json_writer& w, const node_state& n);

/// Whether a request for the reserved task asks for the spans of a trace.
bool is_spans_request(const protocol::request_line& request) noexcept;

/// Serves a request for the reserved task `cles`, except cancellations (docs/protocol.md, "The reserved task").
void serve_reserved(node_state& host, reply_writer& replies, const protocol::request_line& request,
                    const identity& peer);

} // namespace cles::core
