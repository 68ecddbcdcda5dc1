// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>
#include <cstddef>
#include <vector>

namespace cles::runtime {

/// Tracks the job of each worker, and finds workers that are stuck: their job continues although its deadline passed,
/// or it was told to stop, longer than the grace period ago.
///
/// It also says how many workers may look for jobs at once: a stuck worker is replaced while there are replacements.
class worker_watchdog {
  public:
    worker_watchdog(std::size_t workers, std::size_t replacements, std::chrono::nanoseconds grace);

    /// A worker begins to look for jobs. Returns its slot; there is one for each allowed worker.
    std::size_t enter();
    void leave(std::size_t slot) noexcept;
    void begin(std::size_t slot, const void* job, time_point now, time_point deadline) noexcept;
    /// The worker's job has ended. Returns whether the worker was stuck.
    bool end(std::size_t slot) noexcept;
    /// The job has been told to stop. Does nothing if that worker does not run the job any more.
    void stop(std::size_t slot, const void* job, time_point now) noexcept;

    struct stuck_worker {
        std::size_t slot;
        const void* job;
        std::chrono::nanoseconds busy_for;
        bool replaced; ///< by another worker
    };
    /// Calls `found(stuck_worker)` once for each worker that has become stuck.
    template <class F>
    void check(time_point now, F&& found) {
        for (std::size_t i = 0; i < slots_.size(); ++i) {
            if (is_due(slots_[i], now)) {
                found(mark_stuck(i, now));
            }
        }
    }

    /// How many workers may look for jobs, including stuck ones that were replaced.
    [[nodiscard]] std::size_t allowed() const noexcept { return workers_ + replaced_; }
    /// How many workers are not stuck.
    [[nodiscard]] std::size_t usable() const noexcept { return workers_ + replaced_ - stuck_; }
    [[nodiscard]] std::size_t stuck() const noexcept { return stuck_; }

  private:
    struct worker {
        bool in_use = false;
        bool stuck = false;
        bool replaced = false;
        const void* job = nullptr;
        time_point since{};
        time_point due{}; ///< when the job should have ended
    };
    [[nodiscard]] bool is_due(const worker& w, time_point now) const noexcept {
        return w.job != nullptr && !w.stuck && now - w.due > grace_;
    }
    stuck_worker mark_stuck(std::size_t slot, time_point now) noexcept;

    std::size_t workers_;
    std::size_t replacements_;
    std::chrono::nanoseconds grace_;
    std::vector<worker> slots_;
    std::size_t stuck_ = 0;
    std::size_t replaced_ = 0; // stuck workers with a replacement
};

} // namespace cles::runtime
