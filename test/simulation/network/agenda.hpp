// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "port/environment.hpp"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <utility>

namespace cles::simulation {

/// Virtual time, and the events that are scheduled: in the order of time, and at the same time in the order in which
/// they were added.
class agenda final : public core::clock {
  public:
    using action = std::function<void()>;

    [[nodiscard]] time_point now() const override { return now_; }
    void at(time_point when, action what) {
        if (!over_) {
            entries_.emplace(std::max(when, now_), std::move(what)); // after those of the same time
        }
    }
    void later(std::chrono::nanoseconds by, action what) { at(now_ + by, std::move(what)); }
    /// Advances the time to this point.
    void run_until(time_point end) {
        while (!entries_.empty() && entries_.begin()->first <= end) {
            const auto next = entries_.extract(entries_.begin());
            now_ = next.key();
            ++steps_;
            next.mapped()();
            if (every_ && steps_ % 64 == 0) {
                every_();
            }
        }
        now_ = std::max(now_, end);
    }
    /// A check that runs periodically.
    void watch(action every) { every_ = std::move(every); }
    [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
    /// No further events run.
    void clear() {
        over_ = true;
        every_ = nullptr;
        std::exchange(entries_, {});
    }

  private:
    time_point now_{std::chrono::hours{1}};
    std::uint64_t steps_ = 0;
    std::multimap<time_point, action> entries_;
    action every_;
    bool over_ = false;
};

} // namespace cles::simulation
