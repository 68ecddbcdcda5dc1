// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// Small random numbers that keep nodes from doing the same thing at the same time. Not for secrets.
class jitter {
  public:
    explicit jitter(std::uint32_t seed) noexcept : state_(seed | 1U) {}

    /// Up to a quarter of the span.
    std::chrono::milliseconds quarter_of(std::chrono::milliseconds span) noexcept {
        return std::chrono::milliseconds{next() % static_cast<std::uint32_t>(span.count() / 4 + 1)};
    }
    /// From 0 to `bound - 1`; `bound` is from 1 to 2^32. The bias is below bound / 2^32.
    std::size_t below(std::size_t bound) noexcept { return next() % bound; }

  private:
    std::uint32_t next() noexcept {
        state_ ^= state_ << 13U; // xorshift32 (Marsaglia 2003)
        state_ ^= state_ >> 17U;
        state_ ^= state_ << 5U;
        return state_;
    }

    std::uint32_t state_;
};

/// A pause that doubles each time it is used.
class doubling_pause {
  public:
    constexpr explicit doubling_pause(std::chrono::milliseconds first) noexcept : next_(first) {}

    /// The pause to make now; the next one is at most `longest`.
    constexpr std::chrono::milliseconds take(std::chrono::milliseconds longest) noexcept {
        return std::exchange(next_, std::min(next_ * 2, longest));
    }

  private:
    std::chrono::milliseconds next_;
};

/// Pauses between attempts: doubling from the first to the longest, each shortened by up to a quarter, so that nodes
/// that lost the same peer do not return at the same time.
class backoff {
  public:
    using milliseconds = std::chrono::milliseconds;

    explicit backoff(std::uint32_t seed, milliseconds first = milliseconds{100},
                     milliseconds longest = milliseconds{5000}) noexcept
        : first_(first), longest_(longest), pause_(first), jitter_(seed) {}

    milliseconds next() noexcept {
        const auto pause = pause_.take(longest_);
        return pause - jitter_.quarter_of(pause);
    }
    void reset() noexcept { pause_ = doubling_pause{first_}; }

  private:
    milliseconds first_;
    milliseconds longest_;
    doubling_pause pause_;
    jitter jitter_;
};

/// The copies of one request that is sent by datagram: always the same bytes, and when to send them again.
///
/// The pauses double, but stay well below the time for which a node remembers its replies: a later copy would run the
/// request a second time.
class retransmission {
  public:
    static constexpr std::chrono::milliseconds first_pause{200};
    static constexpr std::chrono::milliseconds max_pause{10'000};

    /// `bytes` has just been sent for the first time; nothing is sent from `end` on.
    retransmission(std::string bytes, time_point now, time_point end, std::uint32_t seed)
        : bytes_(std::move(bytes)), sent_(now), end_(end), jitter_(seed) {
        plan(now);
    }

    /// When to check again: at the time of the next copy, or at the end.
    [[nodiscard]] time_point next() const noexcept { return std::min(next_, end_); }
    /// When it was sent last.
    [[nodiscard]] time_point sent() const noexcept { return sent_; }
    [[nodiscard]] bool over(time_point now) const noexcept { return now >= end_; }
    /// Returns the bytes of one more copy, and schedules the next.
    std::string_view again(time_point now) noexcept {
        sent_ = now;
        plan(now);
        return bytes_;
    }

  private:
    void plan(time_point now) noexcept {
        const auto pause = pause_.take(max_pause);
        next_ = now + pause + jitter_.quarter_of(pause);
    }

    std::string bytes_;
    time_point sent_;
    time_point end_;
    time_point next_{};
    doubling_pause pause_{first_pause};
    jitter jitter_;
};

} // namespace cles::core
