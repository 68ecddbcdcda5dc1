// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>

namespace cles::core {

/// Small random amounts that keep many who do the same from doing it in step. Not for secrets.
class jitter {
  public:
    explicit jitter(std::uint32_t seed) noexcept : state_(seed | 1U) {}

    /// Up to a quarter of the span.
    std::chrono::milliseconds quarter_of(std::chrono::milliseconds span) noexcept {
        state_ ^= state_ << 13U; // xorshift32 (Marsaglia 2003)
        state_ ^= state_ >> 17U;
        state_ ^= state_ << 5U;
        return std::chrono::milliseconds{state_ % static_cast<std::uint32_t>(span.count() / 4 + 1)};
    }

  private:
    std::uint32_t state_;
};

} // namespace cles::core
