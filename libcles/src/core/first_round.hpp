// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/deadlines.hpp"

#include <chrono>
#include <cstdint>

namespace cles::core {

/// The time after a node's start in which it asks its group who is there: a name that is not known yet may still be.
class first_round final : private deadline {
  public:
    class listener {
      public:
        listener() = default;
        listener(const listener&) = delete;
        listener& operator=(const listener&) = delete;
        virtual void on_round_over() = 0;

      protected:
        ~listener() = default;
    };

    static constexpr std::chrono::milliseconds length{300};

    first_round(listener& owner, deadline_queue& deadlines) noexcept : owner_(owner), deadlines_(deadlines) {}

    /// There will be one; time has not begun to run.
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
        owner_.on_round_over();
    }

    listener& owner_;
    deadline_queue& deadlines_;
    state state_ = state::over;
};

} // namespace cles::core
