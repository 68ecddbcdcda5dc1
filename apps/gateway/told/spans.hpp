// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "commands/trace_tree.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace gateway {

/// A span as collectors of OpenTelemetry take it: its times are those of the gateway's clock.
struct placed_span {
    std::string node{};
    std::string id{};
    std::string parent{}; ///< empty: none
    std::string name{};
    bool is_client = false;    ///< of a request that was sent, not received
    std::int64_t start_ns = 0; ///< since 1970
    std::int64_t end_ns = 0;
    std::string outcome{};
};
struct traced_span {
    std::string trace{};
    placed_span span{};
};

/// The identity of a request in `traceparent` (W3C Trace Context).
struct trace_parent {
    std::string trace{}; ///< 32 hex digits
    std::string span{};  ///< 16 hex digits
    bool is_sampled = false;
};
/// Empty members if the text has another form.
trace_parent parse_trace_parent(std::string_view text);
std::string to_text(const trace_parent& parent);

/// What a node replies to `PULL NODE:cles/trace/<id>`, without what cannot be used. \throws cles::error
tool::trace_document read_trace(std::string_view reply);
/// Adds the nodes to which the spans have been sent, if they are not there yet, until there are `most`.
void add_nodes(const tool::trace_document& document, std::vector<std::string>& names, std::size_t most);

/// The spans that nodes have recorded of one trace, placed by those that have caused them. Clocks of nodes are not
/// compared: a request that was received is in the middle of the time for which its sender has waited. What was caused
/// by none of the spans is left out. \param root the span of the request at the gateway
std::vector<placed_span> place_spans(const placed_span& root, const std::vector<tool::trace_document>& nodes);

/// The body of a request to a collector (OTLP/HTTP, JSON).
std::string otlp_document(const std::vector<traced_span>& spans);

} // namespace gateway
