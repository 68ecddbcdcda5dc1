// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/deadlines.hpp"
#include "core/jitter.hpp"

#include <chrono>
#include <cstdint>

namespace cles::core {

/// Keeps a binding alive that lives for a lease only: says when to renew it. At a third of the lease, a little less so
/// that many do not do it in step.
class renewal final : private deadline {
  public:
    class keeper {
      public:
        keeper() = default;
        keeper(const keeper&) = delete;
        keeper& operator=(const keeper&) = delete;
        /// Asks for the binding again; whatever comes of it by `until`, `renewed` or `put_off` follows, or `stop`.
        virtual void renew(time_point until) = 0;

      protected:
        ~keeper() = default;
    };

    renewal(keeper& owner, deadline_queue& deadlines, std::uint32_t seed) noexcept
        : owner_(owner), deadlines_(deadlines), jitter_(seed) {}

    /// The binding that was asked for then has been made, for so long.
    void begin(time_point asked, std::chrono::milliseconds lease);
    /// The publisher has renewed what was asked for then. From then on, not from its answer, the lease counts: so it
    /// never ends at the publisher before it does here.
    void renewed(time_point asked);
    /// The publisher was busy: tried again within what is left. False: there is nothing left.
    bool put_off(time_point now);
    void stop() noexcept { deadlines_.disarm(*this); }

    [[nodiscard]] time_point until() const noexcept { return until_; }

  private:
    void on_deadline(time_point now) override;

    keeper& owner_;
    deadline_queue& deadlines_;
    jitter jitter_;
    std::chrono::milliseconds lease_{0};
    time_point until_{};
};

} // namespace cles::core
