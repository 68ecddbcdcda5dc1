// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/deadlines.hpp"

#include <chrono>

namespace cles::core {

/// Watches one stream for a peer that is of no use: one that never sends a line, and one that ended its stream and may
/// have vanished since (docs/protocol.md, "Closing a link").
///
/// A peer that has ended its stream may still read, so its link is kept while bindings live or an answer is owed.
/// Nothing more arrives on it, hence only writing shows whether the peer still exists: an empty line, which every node
/// ignores, and which a peer that is gone answers with a reset.
class link_monitor final : private deadline {
  public:
    static constexpr std::chrono::seconds longest_pause{15};

    class owner {
      public:
        owner() = default;
        owner(const owner&) = delete;
        owner& operator=(const owner&) = delete;
        /// No whole line arrived in time.
        virtual void on_silence() = 0;
        /// An empty line is due.
        virtual void on_probe() = 0;

      protected:
        ~owner() = default;
    };

    link_monitor(owner& of, deadline_queue& deadlines, const limits& bounds, time_point now) noexcept
        : owner_(of), deadlines_(deadlines), bounds_(bounds), opened_(now), last_line_(now) {}

    /// The first line has to arrive within `limits::first_line`.
    void expect_line();
    /// A line has arrived.
    void on_line(time_point now) noexcept {
        last_line_ = now;
        if (!has_spoken_) {
            has_spoken_ = true;
            deadlines_.disarm(*this);
        }
    }
    /// The peer sends no more, and the link is kept.
    void on_end(time_point now);
    /// The link ends.
    void stop() noexcept { deadlines_.disarm(*this); }

    [[nodiscard]] time_point opened() const noexcept { return opened_; }
    [[nodiscard]] bool has_spoken() const noexcept { return has_spoken_; }
    /// When the last line arrived; when the link was opened, where none has.
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
    bool has_spoken_ = false;
    bool half_closed_ = false;
};

} // namespace cles::core
