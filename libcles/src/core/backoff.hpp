// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/jitter.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace cles::core {

/// Pauses between tries: doubling from the first to the longest, each shortened by up to a quarter so that many who
/// lost the same peer do not come back in step.
class backoff {
  public:
    using milliseconds = std::chrono::milliseconds;

    explicit backoff(std::uint32_t seed, milliseconds first = milliseconds{100},
                     milliseconds longest = milliseconds{5000}) noexcept
        : first_(first), longest_(longest), next_(first), jitter_(seed) {}

    milliseconds next() noexcept {
        const auto pause = next_ - jitter_.quarter_of(next_);
        next_ = std::min(next_ * 2, longest_);
        return pause;
    }
    void reset() noexcept { next_ = first_; }

  private:
    milliseconds first_;
    milliseconds longest_;
    milliseconds next_;
    jitter jitter_;
};

} // namespace cles::core
