// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/dedup.hpp"
#include "core/node.hpp"
#include "core/outlet.hpp"
#include "core/reply_writer.hpp"
#include "protocol/message.hpp"

namespace cles::core {

/// What stands before requests that come by datagram, which the network may lose, double and reorder: those that must
/// not run twice need an id, and are known again when they are repeated (docs/protocol.md, "UDP").
class datagram_requests {
  public:
    datagram_requests(node& host, outlet& out, reply_writer& replies);

    /// Whether it is to be served. False where it has been dealt with: refused, or a repeat.
    bool admit(const protocol::request_line& request);
    /// A request that may be repeated, and whose answer takes its time.
    void begin_repeatable(const protocol::request_line& request) { seen_.begin_repeatable(request.id, request.text); }
    /// Nothing is remembered.
    [[nodiscard]] bool empty() const noexcept { return seen_.empty(); }

  private:
    node& node_;
    outlet& out_;
    reply_writer& replies_;
    dedup seen_;
};

} // namespace cles::core
