// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/limits.hpp>
#include <cles/pending.hpp>

#include "protocol/request_line.hpp"
#include "protocol/traceparent.hpp"

#include <chrono>
#include <cstdint>
#include <memory>
#include <string_view>

namespace cles::core {

class clock;
struct node_state;

/// Records what a node does for traced requests (docs/protocol.md, "Traces"). Each function is only called for a trace
/// that is sampled, except `write`. An interface, so that a program that does not record does not link it.
class span_recorder {
  public:
    span_recorder() = default;
    span_recorder(const span_recorder&) = delete;
    span_recorder& operator=(const span_recorder&) = delete;
    virtual ~span_recorder() = default;

    /// A request has been received; it is served from `now` on, and waited for its turn before that. Returns the trace
    /// with this span, which is the parent of what the request causes.
    [[nodiscard]] virtual protocol::trace_context receive(const protocol::request_line& r, time_point arrived,
                                                          time_point now) = 0;
    /// It has waited for a worker, and run, for so much longer. Also after `end`.
    virtual void add_times(std::uint64_t span, std::chrono::nanoseconds queued, std::chrono::nanoseconds ran) = 0;
    /// It has been answered with "ok" or the name of an error; or nobody waits for its answer. A span that is not known
    /// is ignored.
    virtual void end(std::uint64_t span, std::string_view outcome, time_point now) = 0;

    /// A request is about to be sent: replaces the span in it. \param next the node to which it is sent, if another one
    /// than its target \return the operation for its reply
    [[nodiscard]] virtual detail::pending_ptr send(protocol::outgoing_request& r, std::string_view next,
                                                   detail::pending_ptr operation, time_point now) = 0;

    /// Writes the reply to `PULL self:cles/trace/<id>`.
    virtual void write(json_writer& w, const protocol::trace_id& id, time_point now) = 0;
};

} // namespace cles::core

namespace cles::detail {

/// Creates the recorder of a node.
struct tracing_part {
    /// \param time outlives it, except for operations that it has returned
    std::shared_ptr<core::span_recorder> (*make)(const core::node_state& host, const core::clock& time);
};

} // namespace cles::detail
