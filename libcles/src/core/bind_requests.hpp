// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "core/leases.hpp"
#include "core/link_bindings.hpp"
#include "core/node.hpp"
#include "core/outlet.hpp"
#include "core/reply_writer.hpp"
#include "protocol/message.hpp"

#include <cstddef>
#include <optional>

namespace cles::core {

/// Asks the handler for BIND of this noun, if there is one; it says by an exception that it will not have this one.
void ask_bind_handler(const node& host, const identity& peer, const protocol::request_line& request);

/// Serves BIND for one link, and holds what has come of it.
class bind_requests {
  public:
    bind_requests(node& host, const outlet& out, binder& updates, const identity& peer, reply_writer& replies);

    void serve(const protocol::request_line& request, time_point now);
    void clear();
    /// Puts updates that wait to the link, which has room again.
    void drain(time_point now) { bound_.drain(now); }
    [[nodiscard]] std::size_t size() const noexcept { return bound_.size(); }
    [[nodiscard]] bool empty() const noexcept { return bound_.empty(); }

  private:
    node& node_;
    const identity& peer_;
    reply_writer& replies_;
    link_bindings bound_;
    std::optional<leases> leases_; // where nothing tells that the peer has gone
};

} // namespace cles::core
