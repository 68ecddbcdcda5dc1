// SPDX-License-Identifier: BSL-1.0
#include "jobs/worker_watchdog.hpp"

#include <algorithm>

namespace cles::runtime {

worker_watchdog::worker_watchdog(std::size_t workers, std::size_t replacements, std::chrono::nanoseconds grace)
    : workers_(workers), replacements_(replacements), grace_(grace), slots_(workers + replacements) {}

std::size_t worker_watchdog::enter() {
    const auto free = std::find_if(slots_.begin(), slots_.end(), [](const worker& w) { return !w.in_use; });
    *free = {.in_use = true};
    return static_cast<std::size_t>(free - slots_.begin());
}

void worker_watchdog::leave(std::size_t slot) noexcept { slots_[slot].in_use = false; }

void worker_watchdog::begin(std::size_t slot, const void* job, time_point now, time_point deadline) noexcept {
    auto& w = slots_[slot];
    w.job = job;
    w.since = now;
    w.due = deadline;
}

bool worker_watchdog::end(std::size_t slot) noexcept {
    auto& w = slots_[slot];
    w.job = nullptr;
    if (!w.stuck) {
        return false;
    }
    --stuck_;
    replaced_ -= w.replaced ? 1 : 0;
    w.stuck = w.replaced = false;
    return true;
}

void worker_watchdog::stop(std::size_t slot, const void* job, time_point now) noexcept {
    auto& w = slots_[slot];
    if (w.job == job) {
        w.due = std::min(w.due, now);
    }
}

worker_watchdog::stuck_worker worker_watchdog::mark_stuck(std::size_t slot, time_point now) noexcept {
    auto& w = slots_[slot];
    w.stuck = true;
    ++stuck_;
    w.replaced = replaced_ < replacements_;
    replaced_ += w.replaced ? 1 : 0;
    return {.slot = slot, .job = w.job, .busy_for = now - w.since, .replaced = w.replaced};
}

} // namespace cles::runtime
