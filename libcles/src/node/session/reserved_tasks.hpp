// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/session/reply_writer.hpp"

#include <cstdint>

namespace cles::core {

/// What is told of the tasks of a node. A datagram does not hold many, with what they do.
enum class told_tasks : std::uint8_t { described, named, none };
/// Writes `tasks` of the reply to `PULL self:cles`.
void write_tasks(json_writer& w, const node_state& n, told_tasks told = told_tasks::described);
/// Writes the reply to `PULL self:cles`.
void write_description(json_writer& w, const node_state& n, told_tasks told = told_tasks::described);
/// Datagrams hold little more than all counters with their names, so there those that are 0 are left out.
enum class shown_counters : std::uint8_t { all, not_zero };
/// Writes the reply to `PULL self:cles/metrics`.
void write_metrics(json_writer& w, const node_state& n, shown_counters shown = shown_counters::all);

/// Whether a request for the reserved task asks for the spans of a trace.
bool is_spans_request(const protocol::request_line& request) noexcept;

/// Serves a request for the reserved task `cles`, except cancellations (docs/protocol.md, "The reserved task").
void serve_reserved(node_state& host, reply_writer& replies, const protocol::request_line& request,
                    const identity& peer);

} // namespace cles::core
