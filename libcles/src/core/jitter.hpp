// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace cles::core {

/// Small random amounts that keep many who do the same from doing it in step. Not for secrets.
class jitter {
  public:
    explicit jitter(std::uint32_t seed) noexcept : state_(seed | 1U) {}

    /// Up to a quarter of the span.
    std::chrono::milliseconds quarter_of(std::chrono::milliseconds span) noexcept {
        return std::chrono::milliseconds{next() % static_cast<std::uint32_t>(span.count() / 4 + 1)};
    }
    /// From 0 on, less than `most`, which is not 0.
    std::size_t below(std::size_t most) noexcept { return next() % most; }

  private:
    std::uint32_t next() noexcept {
        state_ ^= state_ << 13U; // xorshift32 (Marsaglia 2003)
        state_ ^= state_ >> 17U;
        state_ ^= state_ << 5U;
        return state_;
    }

    std::uint32_t state_;
};

} // namespace cles::core
