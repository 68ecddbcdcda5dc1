// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <utility>

namespace cles::core {

/// Whether updates go out in this turn of the executor, or wait for more to come with the next, so that one write
/// carries them all. They wait while each turn brings more, until there are `most` or `longest` has passed since some
/// went out last. So one that comes alone, after a while, goes at once; but not where several came together before, as
/// from a program that publishes them all in each of its cycles.
class update_gathering {
  public:
    static constexpr std::chrono::microseconds longest{100};
    static constexpr std::uint64_t most = 32; // half of what is kept for a binder unless it asks for more or less

    /// One has come and nothing has asked for a turn: none has gone out for a while, and the last that did was alone.
    [[nodiscard]] bool alone(time_point now) noexcept {
        followed_ = followed_ || !is_late(now);
        return !several_ && !followed_;
    }
    /// `published`: how many there have been so far, of which some have not gone out.
    [[nodiscard]] bool waits(std::uint64_t published, time_point now) noexcept {
        if (published == seen_) {
            return false;
        }
        seen_ = published;
        return !is_late(now) && published - gone_ < most;
    }
    /// All have gone out, `published` of them.
    void gone(std::uint64_t published, time_point now) noexcept {
        several_ = std::exchange(followed_, false) || published - gone_ > 1;
        seen_ = published;
        gone_ = published;
        gone_at_ = now;
    }

  private:
    [[nodiscard]] bool is_late(time_point now) const noexcept { return !gone_at_ || now - *gone_at_ >= longest; }

    std::uint64_t seen_ = 0;
    std::uint64_t gone_ = 0;
    std::optional<time_point> gone_at_; // when the last did
    bool followed_ = false;             // by one that came soon behind it
    bool several_ = false;              // went out together, or soon behind each other
};

} // namespace cles::core
