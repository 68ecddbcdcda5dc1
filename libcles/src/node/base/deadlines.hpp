// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <ratio>
#include <utility>
#include <vector>

namespace cles::core {

/// The point in time that is `by` after (or before) `from`, or the last or first one that exists if it would lie
/// beyond. A duration that is not a constant comes from an option, a peer or a plugin, and may have any value.
template <class Rep, class Period>
[[nodiscard]] constexpr time_point saturating_add(time_point from, std::chrono::duration<Rep, Period> by) noexcept {
    using coarse = std::chrono::duration<double, std::ratio<3600>>; // compares without overflow
    using exact = time_point::duration;
    if (by >= decltype(by)::zero()) {
        const auto left = exact::max() - std::max(from.time_since_epoch(), exact::zero());
        return coarse{by} >= coarse{left} ? time_point::max() : from + std::chrono::duration_cast<exact>(by);
    }
    const auto left = exact::min() - std::min(from.time_since_epoch(), exact::zero());
    return coarse{by} <= coarse{left} ? time_point::min() : from + std::chrono::duration_cast<exact>(by);
}

class environment;
class deadline_queue;

/// Something that happens at a point in time, unless it is disarmed or destroyed first.
class deadline {
  public:
    deadline() = default;
    deadline(const deadline&) = delete;
    deadline& operator=(const deadline&) = delete;

    [[nodiscard]] bool armed() const noexcept { return queue_ != nullptr; }
    [[nodiscard]] time_point due() const noexcept { return due_; }

  protected:
    ~deadline();

  private:
    friend deadline_queue;
    virtual void on_deadline(time_point now) = 0;

    deadline_queue* queue_ = nullptr;
    std::size_t place_ = 0;
    time_point due_{};
};

/// All deadlines of a service, the earliest first: a binary heap of borrowed entries, so that one timer serves them
/// all. Deadlines that are armed in order, as those of equal timeouts are, take constant time.
class deadline_queue {
  public:
    deadline_queue() = default;
    deadline_queue(const deadline_queue&) = delete;
    deadline_queue& operator=(const deadline_queue&) = delete;
    ~deadline_queue();

    /// `on_earliest` is called with the earliest due time when a deadline becomes the first. It may be called for a
    /// deadline that is disarmed soon after.
    void set_observer(std::function<void(time_point)> on_earliest) { on_earliest_ = std::move(on_earliest); }
    /// Arms it again if it is armed already.
    void arm(deadline& d, time_point due);
    void disarm(deadline& d) noexcept;
    [[nodiscard]] std::optional<time_point> next() const noexcept;
    /// Runs everything that is due, including what is armed meanwhile for `now` or earlier.
    void expire(time_point now);
    [[nodiscard]] std::size_t size() const noexcept { return heap_.size(); }

  private:
    void place(deadline& d, std::size_t at) noexcept;
    void rise(std::size_t at) noexcept;
    void sink(std::size_t at) noexcept;

    std::vector<deadline*> heap_;
    std::function<void(time_point)> on_earliest_;
};

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

    void follow(time_point earliest);

    /// Lives while the deadlines expire whose timer has ended, and then sets the timer again, also after an exception:
    /// without it no further deadline would expire.
    class expiry {
      public:
        expiry(deadline_schedule& of, const deadline_queue& deadlines) noexcept : of_(of), deadlines_(deadlines) {
            of_.set_for_ = time_point::min();
        }
        expiry(const expiry&) = delete;
        expiry& operator=(const expiry&) = delete;
        ~expiry();

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
