// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>
#include <cstddef>
#include <vector>

namespace cles::runtime {

/// Knows since when each worker has been at its job, and finds those that are stuck: whose job goes on although its
/// time has been over, or it has been told to stop, for longer than the grace.
///
/// It says how many workers may look for jobs at once. A stuck one counts as lost, and makes room for another as long
/// as there are replacements.
class worker_watch {
  public:
    worker_watch(std::size_t workers, std::size_t replacements, std::chrono::nanoseconds grace);

    /// A worker begins to look for jobs. Returns its place; there is one for each that may.
    std::size_t enter();
    void leave(std::size_t place) noexcept;
    void begin(std::size_t place, const void* job, time_point now, time_point deadline) noexcept;
    /// Its job has ended. True where it had been found stuck.
    bool end(std::size_t place) noexcept;
    /// The job is to stop; nothing where that place is not at it (any more).
    void stop(std::size_t place, const void* job, time_point now) noexcept;

    struct finding {
        std::size_t place;
        const void* job;
        std::chrono::nanoseconds busy_for;
        bool replaced; ///< another worker takes its place
    };
    /// Calls `found(finding)` once for each that has become stuck.
    template <class F>
    void check(time_point now, F&& found) {
        for (std::size_t i = 0; i < places_.size(); ++i) {
            if (is_due(places_[i], now)) {
                found(give_up(i, now));
            }
        }
    }

    /// How many workers may look for jobs, the stuck ones that were replaced not counted out.
    [[nodiscard]] std::size_t allowed() const noexcept { return workers_ + replaced_; }
    /// How many are not stuck.
    [[nodiscard]] std::size_t usable() const noexcept { return workers_ + replaced_ - stuck_; }
    [[nodiscard]] std::size_t stuck() const noexcept { return stuck_; }

  private:
    struct worker {
        bool inside = false;
        bool stuck = false;
        bool replaced = false;
        const void* job = nullptr;
        time_point since{};
        time_point due{}; ///< when it should have ended
    };
    [[nodiscard]] bool is_due(const worker& w, time_point now) const noexcept {
        return w.job != nullptr && !w.stuck && now - w.due > grace_;
    }
    finding give_up(std::size_t place, time_point now) noexcept;

    std::size_t workers_;
    std::size_t replacements_;
    std::chrono::nanoseconds grace_;
    std::vector<worker> places_;
    std::size_t stuck_ = 0;
    std::size_t replaced_ = 0; // of the stuck ones
};

} // namespace cles::runtime
