// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/work_pool.hpp"

#include <cles/error.hpp>

#include "jobs/service_time.hpp"

#include <algorithm>
#include <utility>

namespace cles::simulation {

using std::chrono::milliseconds;

namespace {

constexpr milliseconds watch_every{50};
constexpr milliseconds to_stop{5};

} // namespace

work_pool::work_pool(node_run& host)
    : host_(host), queue_(host.fault() == planted::queue_boundless ? 1'000 : most_queued) {}

void work_pool::submit(order what) {
    const auto refuse = [&](milliseconds retry) {
        what.answer->fail({.code = errc::busy,
                           .message = host_.name() + " is busy",
                           .retry_ms = static_cast<std::uint32_t>(retry.count())});
    };
    if (watch_.usable() == 0) {
        refuse(std::chrono::seconds{1});
        return;
    }
    const auto number = ++last_number_;
    auto& j = *jobs_.emplace(number, std::make_unique<job>()).first->second;
    j.number = number;
    j.requester = what.requester;
    if (!queue_.push(j)) {
        jobs_.erase(number);
        refuse(runtime::retry_delay(queue_.size(), watch_.usable(), service_time_.value()));
        return;
    }
    j.what = std::move(what);
    j.what.answer->on_stop([weak = weak_from_this(), number] {
        if (const auto self = weak.lock()) {
            self->stop(number);
        }
    });
    host_.later({}, [self = shared_from_this()] { self->work(); });
}

void work_pool::crash() {
    while (queue_.pop() != nullptr) {
    }
    jobs_.clear();
}

node_load work_pool::load() const noexcept {
    return {.queued = static_cast<std::uint32_t>(queue_.size()),
            .running = static_cast<std::uint32_t>(at_work_),
            .workers = static_cast<std::uint32_t>(watch_.usable())};
}

void work_pool::work() {
    while (at_work_ < watch_.allowed()) {
        auto* next = queue_.pop();
        if (next == nullptr) {
            return;
        }
        auto& j = static_cast<job&>(*next);
        ++at_work_;
        j.at_work = true;
        j.begun = host_.now();
        j.due = j.what.answer->due();
        j.place = watch_.enter();
        watch_.begin(j.place, &j, j.begun, j.due);
        j.what.begun();
        host_.later(j.what.work, [self = shared_from_this(), number = j.number] { self->end(number); });
        if (!std::exchange(watching_, true)) {
            host_.later(watch_every, [self = shared_from_this()] { self->watch(); });
        }
    }
}

void work_pool::end(std::uint64_t number) {
    const auto found = jobs_.find(number);
    if (found == jobs_.end()) {
        return; // it was told to stop, and did
    }
    const auto& j = *found->second;
    service_time_.add(host_.now() - j.begun);
    watch_.end(j.place);
    watch_.leave(j.place);
    --at_work_;
    const auto answer = j.what.answer;
    jobs_.erase(found);
    answer->done("{}");
    work();
}

void work_pool::stop(std::uint64_t number) {
    const auto found = jobs_.find(number);
    if (found == jobs_.end()) {
        return;
    }
    auto& j = *found->second;
    if (j.queued()) {
        queue_.remove(j);
        host_.later({}, [keep = std::move(j.what.answer)] {}); // its requester is being notified
        jobs_.erase(found);
        return;
    }
    j.due = std::min(j.due, host_.now());
    watch_.stop(j.place, &j, host_.now());
    if (j.what.heeds) {
        host_.later(to_stop, [self = shared_from_this(), number] { self->end(number); });
    }
}

void work_pool::watch() {
    if (host_.fault() != planted::stuck_unnoticed) {
        watch_.check(host_.now(), [&](const runtime::worker_watchdog::stuck_worker& found) {
            for (const auto& [number, j] : jobs_) {
                j->known_stuck |= j.get() == found.job;
            }
        });
    }
    work();
    watching_ = !jobs_.empty();
    if (watching_) {
        host_.later(watch_every, [self = shared_from_this()] { self->watch(); });
    }
}

// -- checks --------------------------------------------------------------------------------------------------------

void work_pool::check() {
    if (queue_.size() > most_queued) {
        complain(rule::bounded, "has " + std::to_string(queue_.size()) + " jobs waiting");
    }
    if (at_work_ > workers + replacements) {
        complain(rule::bounded, "has " + std::to_string(at_work_) + " workers at work");
    }
    if (host_.frozen() || host_.was_frozen_until_now()) {
        return;
    }
    for (const auto& [number, j] : jobs_) {
        if (j->at_work && !j->known_stuck &&
            host_.now() > std::max(j->due, host_.thawed_at()) + grace + 2 * watch_every) {
            complain(rule::bounded, "does not know that a worker is stuck");
        }
    }
}

void work_pool::check_rest() {
    if (!jobs_.empty() || !queue_.empty() || at_work_ != 0 || watch_.stuck() != 0) {
        complain(rule::at_rest, "has " + std::to_string(jobs_.size()) + " jobs left");
    }
}

void work_pool::complain(rule which, const std::string& what) {
    host_.watcher().broken(which, host_.name() + " " + what);
}

} // namespace cles::simulation
