// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/fan_out/fan_out.hpp"
#include "perf/support/bare_socket.hpp"
#include "perf/support/multicast_socket.hpp"

#include <optional>
#include <vector>

namespace cles::perf::icd {

/// Publishes the packed struct, as it is written by hand: to each binder's socket in turn, blocking if its buffer is
/// full, or once to a multicast group.
///
/// The first connection is the control connection: it sends an order, and a byte when all binders are ready; the
/// publisher sends a byte back when all has been published.
class publisher {
  public:
    publisher(const url& where, std::optional<multicast_group> group)
        : listener_(listen_on(where)), group_(std::move(group)) {}
    [[nodiscard]] const url& where() const noexcept { return listener_.where; }
    /// Serves until the control connection is closed.
    void run();

  private:
    std::vector<descriptor> sockets_for(const fan_out_order& order);

    listener listener_;
    std::optional<multicast_group> group_;
};

} // namespace cles::perf::icd
