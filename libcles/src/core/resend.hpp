// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/jitter.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// The copies of one request that goes by datagram: what is sent again, byte by byte the same, and when.
///
/// The pauses double, and stay well below the time for which a node remembers what it has answered: else a copy could
/// come after that, and run the request a second time.
class resend {
  public:
    static constexpr std::chrono::milliseconds first_pause{200};
    static constexpr std::chrono::milliseconds longest_pause{10'000};

    /// `bytes` has just been sent for the first time; nothing is sent from `end` on.
    resend(std::string bytes, time_point now, time_point end, std::uint32_t seed)
        : bytes_(std::move(bytes)), end_(end), jitter_(seed) {
        plan(now);
    }

    /// When to ask again what is to be done: the next copy's time, or the end.
    [[nodiscard]] time_point next() const noexcept { return std::min(next_, end_); }
    [[nodiscard]] bool over(time_point now) const noexcept { return now >= end_; }
    /// One more copy is being sent.
    std::string_view again(time_point now) noexcept {
        plan(now);
        return bytes_;
    }

  private:
    void plan(time_point now) noexcept {
        next_ = now + pause_ + jitter_.quarter_of(pause_);
        pause_ = std::min(pause_ * 2, longest_pause);
    }

    std::string bytes_;
    time_point end_;
    time_point next_{};
    std::chrono::milliseconds pause_ = first_pause;
    jitter jitter_;
};

} // namespace cles::core
