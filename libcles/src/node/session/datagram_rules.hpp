// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/node_state.hpp"
#include "node/session/dedup.hpp"
#include "node/session/line_sink.hpp"
#include "node/session/reply_writer.hpp"
#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// Limits what a node sends by datagram to one source: no update that is too large, and to an unverified address no
/// more than its share.
class datagram_output {
  public:
    /// `unverified_address`: the address whose share applies (docs/protocol.md, "Reflection"); empty if there is no
    /// limit.
    datagram_output(node_state& host, std::size_t longest, std::string unverified_address, std::size_t headers)
        : node_(host), max_datagram_(longest), unverified_address_(std::move(unverified_address)), headers_(headers) {}

    /// Appends updates except those that are too large, which the subscriber sees as gaps.
    void append_updates(std::string& out, std::string_view lines);
    /// Removes what an unverified address may not receive now. Call it once for everything that is appended.
    void limit(std::string& out, time_point now);

  private:
    node_state& node_;
    std::size_t max_datagram_;
    std::string unverified_address_;
    std::size_t headers_; // bytes that the network adds to each datagram
};

/// Filters requests that arrive by datagram, which the network may lose, duplicate and reorder: those that must not run
/// twice need an id, and repeats are recognised (docs/protocol.md, "UDP").
class datagram_requests {
  public:
    datagram_requests(node_state& host, line_sink& out, reply_writer& replies);

    /// Whether the request is to be served. False if it has been handled: refused, or recognised as a repeat.
    bool admit(const protocol::request_line& request);
    /// Records a request that may be repeated, and that takes time to answer.
    void add_repeatable(const protocol::request_line& request) { seen_.add_repeatable(request.id, request.text); }
    /// Whether nothing is remembered.
    [[nodiscard]] bool empty() const noexcept { return seen_.empty(); }

  private:
    node_state& node_;
    line_sink& out_;
    reply_writer& replies_;
    dedup seen_;
};

} // namespace cles::core
