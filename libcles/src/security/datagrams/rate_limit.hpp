// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "port/shared_turns.hpp"

#include <algorithm>
#include <cstdint>

namespace cles::security {

/// Permits at most a number of events in any second: a tenth of them at once.
class rate_limit {
  public:
    /// \pre per_second is at least 2
    explicit rate_limit(std::uint32_t per_second) noexcept
        : rate_{.per_second = per_second - at_once_of(per_second), .at_once = at_once_of(per_second)} {}

    /// Whether one more is permitted now; if so, it counts.
    [[nodiscard]] bool take(time_point now) noexcept {
        const bool may = turns_.has(rate_, now);
        if (may) {
            turns_.take(rate_, now);
        }
        return may;
    }

  private:
    static constexpr std::uint32_t at_once_of(std::uint32_t per_second) noexcept {
        return std::max<std::uint32_t>(per_second / 10, 1);
    }

    core::turn_rate rate_;
    core::turn_bucket turns_;
};

} // namespace cles::security
