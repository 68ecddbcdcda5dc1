// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/deadlines.hpp"
#include "core/jitter.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace cles::core {

/// When a node announces itself to its group (docs/protocol.md, "Membership"): in intervals, a little sooner each time
/// so that many do not do it in step; soon where somebody asks, but with a pause between any two. What has changed
/// waits for the next one, so that what a node receives stays level.
class announcer final : private deadline {
  public:
    class voice {
      public:
        voice() = default;
        voice(const voice&) = delete;
        voice& operator=(const voice&) = delete;
        /// Sends an announcement now; the next one follows within `interval`.
        virtual void announce(std::chrono::milliseconds interval) = 0;
        /// How many other nodes are known.
        [[nodiscard]] virtual std::size_t others() const = 0;

      protected:
        ~voice() = default;
    };

    static constexpr std::chrono::milliseconds shortest{1'000};    ///< interval
    static constexpr std::chrono::milliseconds per_node{10};       ///< of interval, in a large network
    static constexpr std::chrono::milliseconds longest{60'000};    ///< interval
    static constexpr std::chrono::milliseconds pause{100};         ///< from one announcement to the next, at least
    static constexpr std::chrono::milliseconds answer_within{250}; ///< of a solicitation

    announcer(voice& owner, deadline_queue& deadlines, std::uint32_t seed) noexcept
        : owner_(owner), deadlines_(deadlines), jitter_(seed) {}

    /// How long it is from one announcement to the next, at most, where so many others are known.
    [[nodiscard]] static std::chrono::milliseconds interval_among(std::size_t others) noexcept;

    /// Begins; before that nothing else has an effect.
    void start(time_point now);
    /// Somebody asks for this node alone: no time is lost.
    void hurry(time_point now);
    /// Somebody wants to know who is there.
    void solicited(time_point now);
    void stop() noexcept;

  private:
    void by(time_point due);
    void on_deadline(time_point now) override;

    voice& owner_;
    deadline_queue& deadlines_;
    jitter jitter_;
    time_point last_{};
    bool started_ = false;
};

} // namespace cles::core
