// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/fan_out/fan_out.hpp"
#include "perf/support/bare_socket.hpp"
#include "perf/support/multicast_socket.hpp"

#include <optional>

namespace cles::perf::icd {

/// The other side of `publisher`: all binders in one process, each with a socket of its own. One thread waits for all
/// of them by `epoll`, because that many blocking threads would compete for the core; one system call reads as many
/// packets as have arrived.
class binders {
  public:
    binders(const url& publisher, std::optional<multicast_group> group)
        : publisher_(publisher), group_(std::move(group)), control_(perf::connect_to(publisher)) {}

    /// Orders a publication, and receives the updates. Latencies are recorded if there is a recorder.
    /// \throws std::system_error, or std::runtime_error if a value was changed
    fan_out_tally run(const fan_out_order& order, latency_recorder* record);

  private:
    url publisher_;
    std::optional<multicast_group> group_;
    descriptor control_;
};

} // namespace cles::perf::icd
