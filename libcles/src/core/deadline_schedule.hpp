// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/absence.hpp"
#include "core/deadlines.hpp"
#include "port/environment.hpp"

#include <optional>

namespace cles::core {

/// When the environment's timer is due: at the earliest deadline. It is set anew only when an earlier deadline comes,
/// so that requests which end in time cost it nothing.
class deadline_schedule {
  public:
    void follow(const deadline_queue& deadlines, environment& by) {
        const auto next = deadlines.next();
        if (!next || (set_for_ && *set_for_ <= *next)) {
            return;
        }
        set_for_ = next;
        absence_.expect(*next, by.now());
        by.set_timer(*next);
    }

    /// The timer has gone off. Whether this node was stopped meanwhile.
    bool on_timer(time_point now) noexcept {
        set_for_.reset();
        return absence_.ended(now);
    }

  private:
    absence absence_;
    std::optional<time_point> set_for_;
};

} // namespace cles::core
