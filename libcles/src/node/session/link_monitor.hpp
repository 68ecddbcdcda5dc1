// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/deadlines.hpp"

#include <chrono>

namespace cles::core {

/// Decides how long a source of datagrams is kept. It never closes a link: it is dropped when nothing has arrived from
/// it for a while and no state is kept for it (a running request, a reply that it may request again, a binding).
class idle_timer final : private deadline {
  public:
    static constexpr std::chrono::seconds quiet{60};

    class keeper {
      public:
        keeper() = default;
        keeper(const keeper&) = delete;
        keeper& operator=(const keeper&) = delete;
        /// Whether no state is kept for the source.
        [[nodiscard]] virtual bool is_idle() const = 0;
        virtual void on_quiet() = 0;

      protected:
        ~keeper() = default;
    };

    /// Starts with the first datagram, whatever its content.
    idle_timer(keeper& owner, deadline_queue& deadlines, time_point now)
        : owner_(owner), deadlines_(deadlines), last_datagram_(now) {
        deadlines_.arm(*this, now + quiet);
    }

    void on_datagram(time_point now) noexcept { last_datagram_ = now; }
    void end() noexcept { deadlines_.disarm(*this); }

  private:
    void on_deadline(time_point now) override {
        if (now - last_datagram_ < quiet) {
            deadlines_.arm(*this, last_datagram_ + quiet);
        } else if (!owner_.is_idle()) {
            deadlines_.arm(*this, now + quiet);
        } else {
            owner_.on_quiet();
        }
    }

    keeper& owner_;
    deadline_queue& deadlines_;
    time_point last_datagram_;
};

/// Watches one stream for a peer that is of no use: one that never sends a line, or one that ended its stream and may
/// have vanished since (docs/protocol.md, "Closing a link").
///
/// A peer that has ended its stream may still read, so its link is kept while it has bindings or outstanding replies.
/// Nothing more arrives on it, so only writing shows whether the peer still exists: an empty line, which every node
/// ignores, and which the host of a vanished peer answers with a reset.
class link_monitor final : private deadline {
  public:
    static constexpr std::chrono::seconds max_pause{15};

    class owner {
      public:
        owner() = default;
        owner(const owner&) = delete;
        owner& operator=(const owner&) = delete;
        /// No complete line arrived in time.
        virtual void on_silence() = 0;
        /// An empty line is due.
        virtual void on_probe() = 0;

      protected:
        ~owner() = default;
    };

    link_monitor(owner& of, deadline_queue& deadlines, const limits& bounds, time_point now) noexcept
        : owner_(of), deadlines_(deadlines), bounds_(bounds), opened_(now), last_line_(now) {}

    /// The first line must arrive within `limits::first_line`.
    void expect_line();
    /// A line has arrived.
    void on_line(time_point now) noexcept {
        last_line_ = now;
        if (!has_received_) {
            has_received_ = true;
            deadlines_.disarm(*this);
        }
    }
    /// The peer sends no more, but the link is kept.
    void on_end(time_point now);
    /// The link ends.
    void stop() noexcept { deadlines_.disarm(*this); }

    [[nodiscard]] time_point opened() const noexcept { return opened_; }
    [[nodiscard]] bool has_received() const noexcept { return has_received_; }
    /// When the last line arrived, or the link was opened if none has.
    [[nodiscard]] time_point last_line() const noexcept { return last_line_; }
    [[nodiscard]] bool is_half_closed() const noexcept { return half_closed_; }
    [[nodiscard]] time_point half_closed_at() const noexcept { return half_closed_at_; }

  private:
    void on_deadline(time_point now) override;

    owner& owner_;
    deadline_queue& deadlines_;
    const limits& bounds_;
    time_point opened_;
    time_point last_line_;
    time_point half_closed_at_{};
    bool has_received_ = false;
    bool half_closed_ = false;
};

} // namespace cles::core
