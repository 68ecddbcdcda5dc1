// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/work_pool.hpp"

#include <cles/error.hpp>

#include "jobs/service_time.hpp"
#include "node/sharing/work_sharing.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace cles::simulation {

using std::chrono::milliseconds;

namespace {

constexpr milliseconds watch_every{50};
constexpr milliseconds to_stop{5};

// When a thread has answered, one time in eight the system runs others before it.
constexpr unsigned interrupted_per_mille = 125;
constexpr std::chrono::microseconds to_become_free{10};
constexpr std::chrono::microseconds longest_interruption{2'000};

} // namespace

work_pool::work_pool(node_run& host, const options& how, idle_meter* meter)
    : host_(host), how_(how), meter_(meter), chance_(host.host()),
      queue_(host.fault() == planted::queue_boundless ? 1'000 : how.most_queued),
      watch_(how.workers, replacements, grace) {
    update_meter();
}

void work_pool::submit(order what) {
    const auto refuse = [&](milliseconds retry) {
        what.answer->fail({.code = errc::busy,
                           .message = host_.name() + " is busy",
                           .retry_ms = static_cast<std::uint32_t>(retry.count())});
    };
    check_granted(what);
    if (draining_ || watch_.usable() == 0) {
        refuse(std::chrono::seconds{1});
        return;
    }
    const auto number = ++last_number_;
    auto& j = *jobs_.emplace(number, std::make_unique<job>()).first->second;
    j.number = number;
    j.requester = what.requester;
    j.movable = sharing_ && sharing_->may_move(*what.answer);
    if (!queue_.push(j)) {
        jobs_.erase(number);
        refuse(runtime::retry_delay(queue_.size(), watch_.usable(), service_time_.value()));
        return;
    }
    update_meter();
    j.what = std::move(what);
    j.what.answer->on_stop(if_alive(weak_from_this(), [number](work_pool& self) { self.stop(number); }));
    if (!std::exchange(burst_end_posted_, true)) {
        host_.later({}, [self = shared_from_this()] {
            self->burst_end_posted_ = false;
            self->work();
            self->report_change();
        });
    }
}

// Nothing more leaves the node, above all no cancellation of what has moved.
void work_pool::crash() {
    while (queue_.pop() != nullptr) {
    }
    jobs_.clear();
    on_drained_ = nullptr;
    if (meter_ != nullptr) {
        meter_->change(metered_, {});
    }
    host_.crash();
    sharing_.reset();
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
            break;
        }
        auto& j = static_cast<job&>(*next);
        ++at_work_;
        j.at_work = true;
        j.begun = host_.now();
        last_begin_ = j.begun;
        j.due = j.what.answer->due();
        j.place = watch_.enter();
        watch_.begin(j.place, &j, j.begun, j.due);
        j.what.begun();
        host_.later(j.what.work, [self = shared_from_this(), number = j.number] { self->end(number); });
        if (!std::exchange(watching_, true)) {
            host_.later(watch_every, [self = shared_from_this()] { self->watch(); });
        }
    }
    update_meter();
}

void work_pool::end(std::uint64_t number) {
    const auto found = jobs_.find(number);
    if (found == jobs_.end()) {
        return; // it was told to stop, and did
    }
    const auto& j = *found->second;
    const auto took = host_.now() - j.begun;
    service_time_.add(took, host_.now());
    service_times_[j.what.task].add(took, host_.now());
    watch_.end(j.place);
    const auto place = j.place;
    const auto answer = j.what.answer;
    jobs_.erase(found);
    if (!how_.lingers) {
        watch_.leave(place);
        --at_work_;
    }
    answer->done("{}");
    if (how_.lingers) {
        const auto span = chance_.chance(interrupted_per_mille) ? chance_.within(longest_interruption) : to_become_free;
        host_.later(span, [self = shared_from_this(), place] { self->free_worker(place); });
    }
    work();
    report_change();
}

void work_pool::free_worker(std::size_t place) {
    watch_.leave(place);
    --at_work_;
    work();
    report_change();
}

std::size_t work_pool::idle() const noexcept { return watch_.usable() - std::min(at_work_, watch_.usable()); }

void work_pool::update_meter() {
    if (meter_ != nullptr) {
        meter_->change(metered_, {.idle = idle(), .waiting = queue_.movable()});
    }
}

void work_pool::stop(std::uint64_t number) {
    const auto found = jobs_.find(number);
    if (found == jobs_.end()) {
        return;
    }
    auto& j = *found->second;
    if (j.queued() || j.moved != 0) {
        queue_.remove(j);
        if (j.moved != 0) {
            sharing_->withdraw(j.moved);
        }
        host_.later({}, [keep = std::move(j.what.answer)] {}); // its requester is being notified
        jobs_.erase(found);
        update_meter();
        update_drain(false);
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
    report_change();
}

// -- jobs that other nodes run -------------------------------------------------------------------------------------

void work_pool::share() { sharing_ = core::make_sharing(host_.local(), *this); }

void work_pool::report_change() {
    if (sharing_) {
        sharing_->on_change();
    }
    update_drain(false);
}

shareable_queue::state work_pool::read_state() const {
    const auto usable = watch_.usable();
    const auto free = host_.fault() == planted::slots_overstated ? usable : idle();
    const auto saturated_for = at_work_ >= watch_.allowed() ? host_.now() - last_begin_ : std::chrono::nanoseconds{0};
    return {.waiting = static_cast<std::uint32_t>(queue_.size()),
            .idle = static_cast<std::uint32_t>(free),
            .workers = static_cast<std::uint32_t>(usable),
            .service_time = std::chrono::ceil<std::chrono::microseconds>(
                saturated_for.count() == 0 ? service_time_.recent(host_.now())
                                           : std::max<std::chrono::nanoseconds>(service_time_.value(), saturated_for)),
            .movable = static_cast<std::uint32_t>(queue_.movable()),
            .movable_queued = queue_.movable_queued(),
            .draining = draining_};
}

void work_pool::offer(job_taker& to) {
    std::vector<job*> taken;
    queue_.visit([&](runtime::job_queue::item& each, std::size_t ahead) {
        auto& j = static_cast<job&>(each);
        const auto known = service_times_.find(j.what.task);
        const auto service_time = known != service_times_.end() ? known->second.value() : std::chrono::nanoseconds{0};
        if (j.movable && to.choose(*j.what.answer, ahead, std::chrono::ceil<std::chrono::microseconds>(service_time))) {
            taken.push_back(&j);
        }
        return !to.full();
    });
    for (auto* j : taken) {
        queue_.remove(*j);
    }
    update_meter();
    for (auto* j : taken) {
        if (!j->what.answer->wanted().grantee.empty()) {
            complain(rule::effects_once, "passes on a job that has moved already");
        }
        ++sent_;
        j->moved = to.take(j->what.answer, j->what.body,
                           if_alive(weak_from_this(), [number = j->number](work_pool& self, bool refused) {
                               self.end_move(number, refused);
                           }));
    }
}

void work_pool::end_move(std::uint64_t number, bool refused) {
    const auto found = jobs_.find(number);
    if (found == jobs_.end()) {
        return; // its node has crashed
    }
    auto& j = *found->second;
    j.moved = 0;
    returned_ += refused ? 1 : 0;
    if (refused || host_.fault() == planted::moved_run_again) {
        j.returned = true;
        queue_.put_back(j);
        update_meter();
        host_.later({}, [self = shared_from_this()] { self->work(); });
        return;
    }
    jobs_.erase(found);
    update_drain(false);
}

// -- the end -------------------------------------------------------------------------------------------------------

void work_pool::drain(milliseconds limit, std::function<void()> done) {
    draining_ = true;
    on_drained_ = std::move(done);
    host_.later({}, [self = shared_from_this()] { self->update_drain(false); });
    host_.later(limit, [self = shared_from_this()] { self->update_drain(true); });
}

void work_pool::update_drain(bool at_limit) {
    if (on_drained_ && (at_limit || jobs_.empty())) {
        const auto done = std::exchange(on_drained_, nullptr);
        fail_open_jobs();
        done();
    }
}

void work_pool::fail_open_jobs() {
    std::vector<std::uint64_t> open;
    for (const auto& [number, j] : jobs_) {
        open.push_back(number);
    }
    for (const auto number : open) {
        const auto& j = *jobs_.at(number);
        const auto answer = j.what.answer;
        const auto code = j.queued() ? errc::busy : errc::unavailable;
        stop(number);
        answer->fail({.code = code, .message = host_.name() + " is shutting down"});
    }
}

// -- checks --------------------------------------------------------------------------------------------------------

void work_pool::check() {
    const auto returned = [](const auto& each) { return each.second->returned && each.second->queued(); };
    if (queue_.size() > how_.most_queued &&
        queue_.size() > how_.most_queued + static_cast<std::size_t>(std::ranges::count_if(jobs_, returned))) {
        complain(rule::bounded, "has " + std::to_string(queue_.size()) + " jobs waiting");
    }
    if (at_work_ > how_.workers + replacements) {
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

// The node accepts a job on a grant only for a worker that is free at that moment.
void work_pool::check_granted(const order& what) {
    if (!what.answer->wanted().grantee.empty() && at_work_ + queue_.size() >= watch_.usable()) {
        complain(rule::bounded, "has accepted a job on a grant without a free worker");
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
