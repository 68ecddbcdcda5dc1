// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "port/clock.hpp"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

namespace cles::simulation {

/// Virtual time, and what is to happen in it: in the order of time, and at one time in the order in which it was
/// entered.
class agenda final : public core::clock {
  public:
    using action = std::function<void()>;

    [[nodiscard]] time_point now() const override { return now_; }
    void at(time_point when, action what) {
        if (over_) {
            return;
        }
        entries_.push_back({std::max(when, now_), order_++, std::move(what)});
        std::push_heap(entries_.begin(), entries_.end(), later);
    }
    /// Lets time go by up to then.
    void run_until(time_point end) {
        while (!entries_.empty() && entries_.front().when <= end) {
            std::pop_heap(entries_.begin(), entries_.end(), later);
            auto next = std::move(entries_.back());
            entries_.pop_back();
            now_ = next.when;
            ++steps_;
            next.what();
            if (every_ && steps_ % 64 == 0) {
                every_();
            }
        }
        now_ = std::max(now_, end);
    }
    /// Something that is looked at now and then.
    void watch(action every) { every_ = std::move(every); }
    [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
    /// Nothing happens any more.
    void clear() {
        over_ = true;
        every_ = nullptr;
        std::exchange(entries_, {});
    }

  private:
    struct entry {
        time_point when;
        std::uint64_t order;
        action what;
    };
    static bool later(const entry& a, const entry& b) noexcept {
        return a.when != b.when ? a.when > b.when : a.order > b.order;
    }

    time_point now_{std::chrono::hours{1}};
    std::uint64_t order_ = 0;
    std::uint64_t steps_ = 0;
    std::vector<entry> entries_;
    action every_;
    bool over_ = false;
};

} // namespace cles::simulation
