// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <vector>

namespace cles::perf {

/// The properties of a bad link.
struct impairment {
    std::chrono::nanoseconds delay{};  ///< of every frame
    std::chrono::nanoseconds jitter{}; ///< on average, on top of the delay: often less, sometimes several times as much
    double loss = 0;                   ///< share of the frames, each independently
    std::uint64_t bits_per_s = 0;      ///< bandwidth; 0: unlimited
    std::size_t queue = 1000;          ///< most frames in flight; further ones are dropped
};

/// One direction of a link: determines when each frame arrives, or that it is lost. Frames stay in order, as on a radio
/// link that retransmits what was not acknowledged: a late frame delays those behind it.
///
/// It uses no clock and no network, and random numbers only from the seed.
class impaired_line {
  public:
    using clock = std::chrono::steady_clock;
    using frame = std::vector<std::byte>;

    impaired_line(const impairment& how, std::uint64_t seed) : how_(how), chance_(seed) {}

    /// Sends a frame.
    void send(clock::time_point now, frame sent);
    /// When the next frame arrives; empty if none is in flight.
    [[nodiscard]] std::optional<clock::time_point> next_arrival() const;
    /// The next frame that has arrived by now, if there is one.
    std::optional<frame> receive(clock::time_point now);

    [[nodiscard]] std::uint64_t carried() const noexcept { return carried_; }
    [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }
    [[nodiscard]] std::uint64_t overflown() const noexcept { return overflown_; }

  private:
    struct travelling {
        clock::time_point arrives;
        frame content;
    };

    clock::duration draw_jitter();

    impairment how_;
    std::mt19937_64 chance_;
    std::deque<travelling> under_way_;
    clock::time_point free_{};         // when the sender can send again
    clock::time_point last_arrival_{}; // nothing arrives before what was sent earlier
    std::uint64_t carried_ = 0;
    std::uint64_t lost_ = 0;
    std::uint64_t overflown_ = 0;
};

} // namespace cles::perf
