// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>
#include <cles/limits.hpp>
#include <cles/pending.hpp>

#include "node/base/completion_queue.hpp"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>

namespace cles::core {

/// Events that have not been fetched yet. Beyond the limits, the oldest values are dropped and replaced by a gap; of
/// status events (the publisher was lost, or bound again), only the latest are kept.
class feed_queue {
  public:
    feed_queue(std::size_t max_values, std::size_t max_bytes) noexcept
        : max_values_(max_values), max_bytes_(max_bytes) {}

    void push(const detail::raw_event& event);
    [[nodiscard]] bool empty() const noexcept { return entries_.empty() && shed_ == 0; }
    /// Passes the oldest event to `deliver`, which may push and pop.
    template <class F>
    void pop(F&& deliver) {
        if (shed_ != 0) {
            const detail::raw_event gap{.kind = feed_event::gap, .missed = shed_};
            shed_ = 0;
            deliver(gap);
            return;
        }
        const auto e = std::move(entries_.front());
        entries_.pop_front();
        forget(e);
        deliver(e.view());
    }

  private:
    static bool is_value(const kept_event& e) noexcept {
        return e.kind == feed_event::update || e.kind == feed_event::current;
    }
    static bool is_status_event(const kept_event& e) noexcept {
        return e.kind == feed_event::lost || e.kind == feed_event::rebound;
    }
    void forget(const kept_event& e) noexcept;
    /// Returns the one after it.
    [[gnu::cold]] std::deque<kept_event>::iterator remove(std::deque<kept_event>::iterator which);
    [[gnu::cold]] void drop_oldest_value();

    std::size_t max_values_;
    std::size_t max_bytes_;
    std::deque<kept_event> entries_;
    std::size_t values_ = 0;
    std::size_t bytes_ = 0;
    std::uint64_t shed_ = 0;
};

/// Connects a feed to its reader: delivers an event to a waiting reader, or keeps it until one asks.
class feed_mailbox {
  public:
    using event_ptr = pending_event_ptr;

    feed_mailbox(const limits& bounds, completion_queue& completions) noexcept
        : queue_(bounds.feed, bounds.binding_bytes), completions_(completions) {}

    enum class hand_over : std::uint8_t { now, later };

    /// Returns false if the event's body is not JSON. Does nothing once closed. `now`: an update may be delivered
    /// inside the call, which must then be the caller's last use of the feed; other events are delivered by a
    /// completion of their own.
    bool put(const detail::raw_event& event, hand_over when = hand_over::now);
    /// Waits for an event. \pre it is open, and nothing else waits. Returns true if an event is available: the caller
    /// then has to call `pump` later, since no operation may complete inside its initiation.
    bool next(event_ptr operation);
    /// Returns whether it has delivered an event.
    bool pump();
    /// Cancels the waiting operation.
    [[gnu::cold]] void cancel();
    /// The same, if it is this one.
    void cancel(const detail::pending_event* operation) {
        if (waiter_.get() == operation) {
            cancel();
        }
    }
    /// Closes it and returns the waiting operation, which the caller has to complete.
    [[nodiscard, gnu::cold]] event_ptr close();
    [[nodiscard]] bool closed() const noexcept { return closed_; }
    [[nodiscard]] bool has_waiter() const noexcept { return waiter_ != nullptr; }

  private:
    feed_queue queue_;
    completion_queue& completions_;
    event_ptr waiter_;
    bool closed_ = false;
};

} // namespace cles::core
