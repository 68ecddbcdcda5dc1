// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe.hpp>

#include <optional>
#include <string>
#include <vector>

namespace tool {

/// A span in the reply to `PULL self:cles/trace/<id>` (docs/protocol.md, "Traces").
struct span_document {
    std::string span;
    std::string parent;
    std::string kind; ///< "received" or "sent"
    std::string verb;
    std::string target;
    std::string task;
    std::optional<std::string> next;
    double start_us = 0;
    std::optional<double> queue_us;
    std::optional<double> run_us;
    std::optional<double> total_us; ///< nothing if it has not ended
    std::optional<std::string> outcome;
};
BOOST_DESCRIBE_STRUCT(span_document, (),
                      (span, parent, kind, verb, target, task, next, start_us, queue_us, run_us, total_us, outcome))

/// The spans of one node.
struct trace_document {
    std::string node;
    std::vector<span_document> spans;
};
BOOST_DESCRIBE_STRUCT(trace_document, (), (node, spans))

/// A node on the way of a request.
struct hop {
    std::string node;
    std::string request; ///< "DELEGATE plan"
    std::optional<double>
        total_us{};                  ///< from receiving it to the reply; if it is not known there, as its sender saw it
    std::optional<double> link_us{}; ///< how much longer it took for the sender
    std::optional<double> queue_us{};
    std::optional<double> run_us{};
    std::optional<std::string> outcome{}; ///< nothing: not yet
    std::vector<hop> hops{};              ///< to which it sent requests, in this order
};
BOOST_DESCRIBE_STRUCT(hop, (), (node, request, total_us, link_us, queue_us, run_us, outcome, hops))

/// The hops below a request that was sent as the span `root`, and for which its sender waited `total_us`. No times of
/// different nodes are compared, only durations.
std::vector<hop> hops_of(const std::vector<trace_document>& nodes, const std::string& root, double total_us);

/// A line for each hop, below that of the sender.
std::string to_table(const hop& sender);

} // namespace tool
