// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/deadlines.hpp"
#include "port/environment.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace cles::core {

/// Detects by a late timer that this node was suspended, so that it may have missed what others sent. A due time that
/// had passed when the timer was set proves nothing.
class suspend_detector {
  public:
    /// How late a timer may be in a running process, however busy.
    static constexpr std::chrono::milliseconds punctual{500};

    /// The timer has been set.
    void expect(time_point due, time_point now) noexcept { expected_ = std::min(expected_, std::max(due, now)); }
    /// The timer has expired. Returns whether the node was suspended meanwhile.
    bool ended(time_point now) noexcept { return now - std::exchange(expected_, time_point::max()) > punctual; }

  private:
    time_point expected_ = time_point::max();
};

/// Keeps the environment's timer set to the earliest deadline. It is set again only for an earlier one, so that
/// requests that complete in time cost nothing.
class deadline_schedule {
  public:
    explicit deadline_schedule(environment& by) noexcept : environment_(by) {}

    void follow(time_point earliest) {
        if (set_for_ <= earliest) {
            return;
        }
        set_for_ = earliest;
        suspend_detector_.expect(earliest, environment_.now());
        environment_.set_timer(earliest);
    }

    /// Lives while the deadlines expire whose timer has ended, and then sets the timer again, also after an exception:
    /// without it no further deadline would expire.
    class expiry {
      public:
        expiry(deadline_schedule& of, const deadline_queue& deadlines) noexcept : of_(of), deadlines_(deadlines) {
            of_.set_for_ = time_point::min();
        }
        expiry(const expiry&) = delete;
        expiry& operator=(const expiry&) = delete;
        ~expiry() {
            of_.set_for_ = time_point::max();
            if (const auto next = deadlines_.next()) {
                of_.follow(*next);
            }
        }

      private:
        deadline_schedule& of_;
        const deadline_queue& deadlines_;
    };

    /// The timer has ended. Returns whether this node was suspended meanwhile.
    bool is_after_suspension(time_point now) noexcept { return suspend_detector_.ended(now); }

  private:
    environment& environment_;
    suspend_detector suspend_detector_;
    time_point set_for_ = time_point::max();
};

} // namespace cles::core
