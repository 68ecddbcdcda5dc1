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

/// How bad a link is.
struct impairment {
    std::chrono::nanoseconds delay{}; ///< of every frame
    std::chrono::nanoseconds
        jitter{};                 ///< on average, on top of the delay: often less, now and then several times as much
    double loss = 0;              ///< share of the frames, each lost apart from the others
    std::uint64_t bits_per_s = 0; ///< what it carries; 0: as much as comes
    std::size_t queue = 1000;     ///< frames under way at most; one that comes when there are as many is dropped
};

/// One direction of a link: takes frames, and says when each arrives, if it does. Frames stay in order, as on a radio
/// link that repeats what was not acknowledged: one that is late holds up those behind it.
///
/// Decides without a clock or a network; chance comes from the seed alone.
class impaired_line {
  public:
    using clock = std::chrono::steady_clock;
    using frame = std::vector<std::byte>;

    impaired_line(const impairment& how, std::uint64_t seed) : how_(how), chance_(seed) {}

    /// A frame is put on the line.
    void send(clock::time_point now, frame sent);
    /// When the next frame arrives; nothing where none is under way.
    [[nodiscard]] std::optional<clock::time_point> next_arrival() const;
    /// The next frame that has arrived by now; nothing where none has.
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
    clock::time_point free_{};         // when the sender has the line for itself again
    clock::time_point last_arrival_{}; // nothing arrives before what was sent earlier
    std::uint64_t carried_ = 0;
    std::uint64_t lost_ = 0;
    std::uint64_t overflown_ = 0;
};

} // namespace cles::perf
