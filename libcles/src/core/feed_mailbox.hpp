// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>
#include <cles/limits.hpp>
#include <cles/pending.hpp>

#include "core/completion_queue.hpp"
#include "core/feed_queue.hpp"

#include <cstdint>
#include <memory>

namespace cles::core {

/// Between what a feed receives and its reader: hands an event to a reader that waits, or keeps it until one asks.
class feed_mailbox {
  public:
    using event_ptr = pending_event_ptr;

    feed_mailbox(const limits& bounds, completion_queue& completions) noexcept
        : queue_(bounds.feed, bounds.binding_bytes), completions_(completions) {}

    enum class hand_over : std::uint8_t { now, later };

    /// False where the event's body is not JSON. Nothing is kept once it is closed. `now`: an update may be handed over
    /// inside the call, which is then the caller's last for this feed; all else waits for a completion of its own.
    bool put(const detail::raw_event& event, hand_over when = hand_over::now);
    /// Waits for an event; it is open, and nobody else waits. True where one is there: `pump` delivers it, which is for
    /// the caller to do later, since an operation must not end while it begins.
    bool next(event_ptr operation);
    void pump();
    /// Withdraws who waits.
    void cancel();
    /// The same, where it is this one.
    void cancel(const detail::pending_event* operation) {
        if (waiter_.get() == operation) {
            cancel();
        }
    }
    /// Takes who waits out; telling him is left to the caller.
    [[nodiscard]] event_ptr close();
    [[nodiscard]] bool closed() const noexcept { return closed_; }
    [[nodiscard]] bool has_waiter() const noexcept { return waiter_ != nullptr; }

  private:
    feed_queue queue_;
    completion_queue& completions_;
    event_ptr waiter_;
    bool closed_ = false;
};

} // namespace cles::core
