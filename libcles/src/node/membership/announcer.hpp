// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/backoff.hpp"
#include "node/base/deadlines.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace cles::core {

/// The time after its start in which a node solicits announcements from its group: an unknown name may still be
/// announced.
class discovery_grace final : private deadline {
  public:
    class listener {
      public:
        listener() = default;
        listener(const listener&) = delete;
        listener& operator=(const listener&) = delete;
        virtual void on_discovery_grace_over() = 0;

      protected:
        ~listener() = default;
    };

    static constexpr std::chrono::milliseconds length{300};

    discovery_grace(listener& owner, deadline_queue& deadlines) noexcept : owner_(owner), deadlines_(deadlines) {}

    /// The grace period will start; its time is not running yet.
    void expect() noexcept { state_ = state::expected; }
    void begin(time_point now) {
        state_ = state::running;
        deadlines_.arm(*this, now + length);
    }
    void stop() noexcept {
        state_ = state::over;
        deadlines_.disarm(*this);
    }
    [[nodiscard]] bool over() const noexcept { return state_ == state::over; }

  private:
    enum class state : std::uint8_t { expected, running, over };

    void on_deadline(time_point) override {
        state_ = state::over;
        owner_.on_discovery_grace_over();
    }

    listener& owner_;
    deadline_queue& deadlines_;
    state state_ = state::over;
};

/// Decides when a node announces itself to its group (docs/protocol.md, "Membership"): once per interval, a little
/// sooner each time so that nodes do not announce in step; soon after a solicitation, but with a pause between any two.
/// Changes wait for the next announcement, which keeps the load on receivers steady.
class announcer final : private deadline {
  public:
    class sender {
      public:
        sender() = default;
        sender(const sender&) = delete;
        sender& operator=(const sender&) = delete;
        /// Sends an announcement now; the next one follows within `interval`.
        virtual void announce(std::chrono::milliseconds interval) = 0;
        /// The number of other known nodes.
        [[nodiscard]] virtual std::size_t others() const = 0;

      protected:
        ~sender() = default;
    };

    static constexpr std::chrono::milliseconds shortest{1'000};    ///< interval
    static constexpr std::chrono::milliseconds per_node{10};       ///< of interval, in a large network
    static constexpr std::chrono::milliseconds longest{60'000};    ///< interval
    static constexpr std::chrono::milliseconds pause{100};         ///< between two announcements, at least
    static constexpr std::chrono::milliseconds answer_within{250}; ///< after a solicitation

    announcer(sender& owner, deadline_queue& deadlines, std::uint32_t seed) noexcept
        : owner_(owner), deadlines_(deadlines), jitter_(seed) {}

    /// The maximum time between two announcements with that many other known nodes.
    [[nodiscard]] static std::chrono::milliseconds interval_among(std::size_t others) noexcept;

    /// Starts announcing; before this, no other call has an effect.
    void start(time_point now);
    /// This node alone was solicited: announces without delay.
    void expedite(time_point now);
    /// All nodes were solicited: announces after a random delay.
    void solicited(time_point now);
    void stop() noexcept;

  private:
    void announce_by(time_point due);
    void on_deadline(time_point now) override;

    sender& owner_;
    deadline_queue& deadlines_;
    jitter jitter_;
    time_point last_{};
    bool started_ = false;
};

} // namespace cles::core
