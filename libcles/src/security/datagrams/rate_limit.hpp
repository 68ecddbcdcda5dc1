// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace cles::security {

/// Permits at most a number of events in any second: a token bucket that holds a tenth of them.
class rate_limit {
  public:
    /// \pre per_second is at least 2
    explicit rate_limit(std::uint32_t per_second) noexcept
        : burst_(std::max<std::uint32_t>(per_second / 10, 1)),
          interval_(std::chrono::nanoseconds{std::chrono::seconds{1}} / (per_second - burst_)) {}

    /// Whether one more is permitted now; if so, it counts.
    [[nodiscard]] bool take(time_point now) noexcept {
        const auto from = std::max(full_, now); // the bucket is full again at `full_`
        if (from - now > interval_ * (burst_ - 1)) {
            return false;
        }
        full_ = from + interval_;
        return true;
    }

  private:
    std::uint32_t burst_;
    std::chrono::nanoseconds interval_;
    time_point full_{};
};

} // namespace cles::security
