// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <algorithm>
#include <chrono>
#include <utility>

namespace cles::core {

/// Notices that this node was stopped, so that others may have spoken while it did not listen: its timer is late. What
/// was due before the timer was set for it says nothing.
class absence {
  public:
    /// How late a timer is where its process runs, however busy.
    static constexpr std::chrono::milliseconds punctual{500};

    /// The timer has been set.
    void expect(time_point due, time_point now) noexcept { expected_ = std::min(expected_, std::max(due, now)); }
    /// It has gone off. Whether the node was away meanwhile.
    bool ended(time_point now) noexcept { return now - std::exchange(expected_, time_point::max()) > punctual; }

  private:
    time_point expected_ = time_point::max();
};

} // namespace cles::core
