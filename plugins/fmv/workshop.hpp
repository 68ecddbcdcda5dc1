// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "streams.hpp"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace fmv {

/// What the tasks of this node share: its streams, and what became of the frames. Thread-safe.
struct workshop {
    workshop(std::size_t most, std::chrono::milliseconds idle, std::optional<std::uint64_t> radar)
        : all(most, idle), radar_seed(radar) {}

    streams all;
    const std::optional<std::uint64_t> radar_seed; ///< of the traffic that its own radar sees; nothing, if it has none
    std::atomic<std::uint64_t> frames{0}, repeated{0}, refused{0}, bad{0};
};

} // namespace fmv
