// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/announcement.hpp"

#include <chrono>
#include <cstdint>
#include <optional>

namespace cles::core {

/// What one node tells of another, or of itself: the last announcement, and how long ago it was made.
struct peer_report {
    announcement said;
    std::uint32_t epoch = 0;
    std::uint64_t seq = 0; ///< 0: not told, as by nodes that know no more than plain tables
    std::chrono::milliseconds age{0};
    bool has_interval = false; ///< whether `said.interval` was told
};

/// The same of a node of which nothing else has changed.
struct peer_beat {
    std::uint32_t epoch = 0;
    std::uint64_t seq = 0;
    std::chrono::milliseconds age{0};
    std::chrono::milliseconds interval{0};
    std::uint32_t queued = 0;
    std::uint32_t running = 0;
};

} // namespace cles::core
