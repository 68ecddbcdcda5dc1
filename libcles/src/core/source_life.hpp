// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/deadlines.hpp"

#include <chrono>

namespace cles::core {

/// How long a source of datagrams is kept in mind. It never says goodbye: it is let go when nothing has been heard from
/// it for a while and nothing is kept for it (a request that runs, a reply that it may ask for again, a binding).
class source_life final : private deadline {
  public:
    static constexpr std::chrono::seconds quiet{60};

    class keeper {
      public:
        keeper() = default;
        keeper(const keeper&) = delete;
        keeper& operator=(const keeper&) = delete;
        /// Nothing is kept for it.
        [[nodiscard]] virtual bool at_rest() const = 0;
        virtual void on_quiet() = 0;

      protected:
        ~keeper() = default;
    };

    /// It begins with the first datagram, whatever that holds.
    source_life(keeper& owner, deadline_queue& deadlines, time_point now)
        : owner_(owner), deadlines_(deadlines), heard_(now) {
        deadlines_.arm(*this, now + quiet);
    }

    void heard(time_point now) noexcept { heard_ = now; }
    void end() noexcept { deadlines_.disarm(*this); }

  private:
    void on_deadline(time_point now) override {
        if (now - heard_ < quiet) {
            deadlines_.arm(*this, heard_ + quiet);
        } else if (!owner_.at_rest()) {
            deadlines_.arm(*this, now + quiet);
        } else {
            owner_.on_quiet();
        }
    }

    keeper& owner_;
    deadline_queue& deadlines_;
    time_point heard_;
};

} // namespace cles::core
