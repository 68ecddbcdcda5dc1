// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <utility>

namespace cles::runtime {

/// How many entries a plugin's process may add to the daemon's log: a burst, then so many a second.
class log_rate {
  public:
    static constexpr std::int64_t burst = 200;
    static constexpr std::chrono::milliseconds interval{10}; // of one entry

    /// Whether an entry may be written now.
    bool take(time_point now) noexcept {
        const auto earned = (now - since_) / interval;
        if (earned > 0) {
            left_ = std::min<std::int64_t>(left_ + earned, burst);
            since_ = left_ == burst ? now : since_ + earned * interval;
        }
        if (left_ == 0) {
            ++dropped_;
            return false;
        }
        --left_;
        return true;
    }
    /// How many were dropped since the last call.
    std::uint64_t take_dropped() noexcept { return std::exchange(dropped_, 0); }

  private:
    time_point since_{};
    std::int64_t left_ = burst;
    std::uint64_t dropped_ = 0;
};

} // namespace cles::runtime
