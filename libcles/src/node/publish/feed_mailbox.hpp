// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>
#include <cles/limits.hpp>
#include <cles/pending.hpp>

#include "node/base/completion_queue.hpp"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <utility>

namespace cles::core {

/// Events that have not been fetched yet. Beyond the limits, the oldest values are dropped and replaced by a gap; of
/// status events (the publisher was lost, or bound again), only the latest are kept.
class feed_queue {
  public:
    feed_queue(std::size_t max_values, std::size_t max_bytes) noexcept
        : max_values_(max_values), max_bytes_(max_bytes) {}

    void push(const detail::raw_event& event) { push(event, max_values_); }
    /// For a reader that soon takes all events: only the limit on bytes counts.
    void push_for_reader(const detail::raw_event& event) { push(event, entries_.max_size()); }
    [[nodiscard]] bool empty() const noexcept { return entries_.empty() && shed_ == 0 && !returned_; }
    /// How many events there are, not counting a gap.
    [[nodiscard]] std::size_t size() const noexcept { return entries_.size() + (returned_ ? 1 : 0); }
    /// Removes the oldest event. \pre there is one
    [[nodiscard]] kept_event take();
    /// Puts back the event that was taken last.
    void put_back(kept_event event) { returned_.emplace(std::move(event)); }
    /// Passes the oldest event to `deliver`, which may push and pop.
    template <class F>
    void pop(F&& deliver) {
        const auto e = take();
        deliver(e.view());
    }
    /// Whether this many values, which somebody else keeps, are within the limits.
    [[nodiscard]] bool has_space(std::size_t values, std::size_t bytes) const noexcept {
        return values < max_values_ && bytes < max_bytes_;
    }

  private:
    static bool is_value(const kept_event& e) noexcept {
        return e.kind == feed_event::update || e.kind == feed_event::current;
    }
    static bool is_status_event(const kept_event& e) noexcept {
        return e.kind == feed_event::lost || e.kind == feed_event::rebound;
    }
    void push(const detail::raw_event& event, std::size_t max_values);
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
    std::optional<kept_event> returned_; // the first of all
};

/// Connects a feed to its reader: delivers an event to a waiting reader, or keeps it until one asks.
///
/// A reader of batches gets all updates that one read of a link brings in one call, and therefore by `pump`: each is
/// read when it arrives, and kept by the operation. What may not be read at once (other events, and updates that
/// several feeds get) waits in the queue. While a reader waits for what is there, the queue may exceed its length.
class feed_mailbox {
  public:
    using event_ptr = pending_event_ptr;

    feed_mailbox(const limits& bounds, completion_queue& completions) noexcept
        : queue_(bounds.feed, bounds.binding_bytes), completions_(completions) {}
    feed_mailbox(const feed_mailbox&) = delete;
    feed_mailbox& operator=(const feed_mailbox&) = delete;
    ~feed_mailbox();

    enum class hand_over : std::uint8_t { now, later };

    /// Sets how to have `pump` called soon; without it, no reader may wait for batches. It may be called again before
    /// `pump` is.
    void set_pump(std::function<void()> pump_soon) { pump_soon_ = std::move(pump_soon); }
    /// Returns false if the event's body is not JSON. Does nothing once closed. `now`: an update may be delivered
    /// inside the call, which must then be the caller's last use of the feed; other events are delivered by a
    /// completion of their own.
    bool put(const detail::raw_event& event, hand_over when = hand_over::now);
    /// Waits for an event. \pre it is open, and nothing else waits. Returns true if an event is available: the caller
    /// then has to call `pump` later, since no operation may complete inside its initiation.
    bool next(event_ptr operation);
    /// Returns whether it has delivered something. The caller keeps the feed.
    bool pump();
    /// Cancels the waiting operation, unless it has something to deliver.
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
    /// How many events have not been fetched.
    [[nodiscard]] std::size_t unfetched() const noexcept { return queue_.size(); }
    [[nodiscard]] bool has_waiter() const noexcept { return waiter_ != nullptr || reading_ != nullptr; }

  private:
    /// The call of a conversion, which is user code: it may close or destroy the feed.
    struct reading {
        bool feed_is_gone = false;
    };

    bool put_in_batch(const detail::raw_event& event, hand_over when);
    bool pump_batch();
    /// Has the batch read an event.
    detail::pending_batch::verdict keep(const detail::raw_event& event, reading& call);
    [[nodiscard]] detail::pending_batch* take_batch() noexcept;
    void announce();

    feed_queue queue_;
    completion_queue& completions_;
    event_ptr waiter_;
    detail::pending_batch* batch_ = nullptr; // the waiter, if it takes several events
    std::size_t kept_ = 0;                   // events that the batch has
    std::size_t kept_bytes_ = 0;             // of their bodies
    reading* reading_ = nullptr; // while the batch reads an event; it waits then, although `waiter_` is null
    std::function<void()> pump_soon_;
    bool is_announced_ = false; // `pump` will be called
    bool closed_ = false;
};

} // namespace cles::core
