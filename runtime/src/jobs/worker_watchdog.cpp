// SPDX-License-Identifier: BSL-1.0
#include "jobs/worker_watchdog.hpp"

#include <algorithm>

namespace cles::runtime {

worker_watch::worker_watch(std::size_t workers, std::size_t replacements, std::chrono::nanoseconds grace)
    : workers_(workers), replacements_(replacements), grace_(grace), places_(workers + replacements) {}

std::size_t worker_watch::enter() {
    const auto free = std::find_if(places_.begin(), places_.end(), [](const worker& w) { return !w.inside; });
    *free = {.inside = true};
    return static_cast<std::size_t>(free - places_.begin());
}

void worker_watch::leave(std::size_t place) noexcept { places_[place].inside = false; }

void worker_watch::begin(std::size_t place, const void* job, time_point now, time_point deadline) noexcept {
    auto& w = places_[place];
    w.job = job;
    w.since = now;
    w.due = deadline;
}

bool worker_watch::end(std::size_t place) noexcept {
    auto& w = places_[place];
    w.job = nullptr;
    if (!w.stuck) {
        return false;
    }
    --stuck_;
    replaced_ -= w.replaced ? 1 : 0;
    w.stuck = w.replaced = false;
    return true;
}

void worker_watch::stop(std::size_t place, const void* job, time_point now) noexcept {
    auto& w = places_[place];
    if (w.job == job) {
        w.due = std::min(w.due, now);
    }
}

worker_watch::finding worker_watch::give_up(std::size_t place, time_point now) noexcept {
    auto& w = places_[place];
    w.stuck = true;
    ++stuck_;
    w.replaced = replaced_ < replacements_;
    replaced_ += w.replaced ? 1 : 0;
    return {.place = place, .job = w.job, .busy_for = now - w.since, .replaced = w.replaced};
}

} // namespace cles::runtime
