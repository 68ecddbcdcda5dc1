// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/agenda.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>

namespace cles::simulation {

/// Adds up for how long workers were idle while jobs that may move waited, on whichever node: at any time, as many
/// workers as are idle, but no more than there are such jobs.
class idle_meter {
  public:
    explicit idle_meter(const agenda& time) noexcept : time_(time), since_(time.now()) {}

    /// A pool's share of what is added up.
    struct figures {
        std::size_t idle = 0;
        std::size_t waiting = 0; ///< jobs that may move
    };

    /// What a pool has now, and had since the last call.
    void change(figures& from, const figures& to) {
        count();
        all_.idle += to.idle - from.idle;
        all_.waiting += to.waiting - from.waiting;
        from = to;
    }
    /// So far; of all workers together.
    [[nodiscard]] std::chrono::duration<double> total() {
        count();
        return total_;
    }

  private:
    void count() {
        const auto passed = time_.now() - since_;
        since_ = time_.now();
        total_ += passed * static_cast<double>(std::min(all_.idle, all_.waiting));
    }

    const agenda& time_;
    time_point since_;
    figures all_;
    std::chrono::duration<double> total_{0};
};

} // namespace cles::simulation
