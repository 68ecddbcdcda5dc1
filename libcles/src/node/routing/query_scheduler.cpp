// SPDX-License-Identifier: BSL-1.0
#include "node/routing/query_scheduler.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace cles::core {
namespace {

// At the permitted rate of failures, fewer endpoints than this can be in their longest pause.
constexpr std::size_t max_endpoints_before_tidying = 8'192;

std::chrono::milliseconds pause_after(unsigned failures) noexcept {
    constexpr unsigned max_doublings = 5;
    return std::min(query_scheduler::first_pause * (1 << std::min(failures - 1, max_doublings)),
                    query_scheduler::max_pause);
}

} // namespace

query_scheduler::query_scheduler(std::function<void(query_target&)> on_postponed)
    : on_postponed_(std::move(on_postponed)) {}

void query_scheduler::enter(query_target& who) {
    if (who.at_ == query_target::place::nowhere) {
        who.at_ = query_target::place::fresh;
        who.order_ = ++last_order_;
        fresh_.emplace(who.order_, &who);
    }
}

void query_scheduler::wait(query_target& who, time_point turn) {
    auto& e = at(who);
    who.at_ = query_target::place::waiting;
    who.turn_ = turn;
    who.order_ = ++last_order_;
    e.waiting.emplace(who.turn_, who.order_, &who);
    schedule(e);
}

bool query_scheduler::remove(query_target& who) {
    const auto was = std::exchange(who.at_, query_target::place::nowhere);
    if (was == query_target::place::fresh) {
        fresh_.erase(who.order_);
    } else if (was == query_target::place::waiting) {
        at(who).waiting.erase({who.turn_, who.order_, &who});
        release(who);
    } else if (was == query_target::place::asked) {
        --asked_;
        --at(who).asking;
        release(who);
    }
    return was != query_target::place::nowhere;
}

query_target* query_scheduler::next(time_point now) {
    if (asked_ >= at_once || now < open_at()) {
        return nullptr;
    }
    newest_ = !newest_;
    auto* found = newest_ ? take_fresh(now) : take_waiting(now);
    if (found == nullptr) {
        found = newest_ ? take_waiting(now) : take_fresh(now);
    }
    return found;
}

// The newest, or the oldest if the waiting ones came first. Those whose URL is in a pause, or is tried by another after
// one, wait with the others of that URL.
query_target* query_scheduler::take_fresh(time_point now) {
    while (!fresh_.empty()) {
        ++steps_;
        const auto which = newest_ ? std::prev(fresh_.end()) : fresh_.begin();
        auto& who = *which->second;
        fresh_.erase(which);
        auto& e = at(who);
        if (e.has_room() && e.closed_until <= now) {
            mark_asked(who, e);
            return &who;
        }
        wait(who, now);
        on_postponed_(who);
    }
    return nullptr;
}

query_target* query_scheduler::take_waiting(time_point now) {
    if (schedule_.empty() || std::get<time_point>(*schedule_.begin()) > now) {
        return nullptr;
    }
    ++steps_;
    auto& e = *std::get<endpoint*>(*schedule_.begin());
    auto& who = *std::get<query_target*>(*e.waiting.begin());
    e.waiting.erase(e.waiting.begin());
    mark_asked(who, e);
    return &who;
}

void query_scheduler::mark_asked(query_target& who, endpoint& e) {
    who.at_ = query_target::place::asked;
    ++asked_;
    ++e.asking;
    schedule(e);
}

void query_scheduler::answered(query_target& who) {
    at(who).failures = 0;
    at(who).closed_until = time_point::min();
    who.failures = 0;
    remove(who);
}

void query_scheduler::failed(query_target& who, bool unreachable, time_point now) {
    forget_idle(now);
    debt_ = std::max(debt_, now) + per_failure;
    ++who.failures;
    auto& e = at(who);
    // If several nodes were asked there at once, only the first failure counts.
    if (unreachable && e.closed_until <= now) {
        ++e.failures;
        e.closed_until = now + pause_after(e.failures);
    }
    --asked_;
    --e.asking;
    wait(who, now + pause_after(who.failures));
}

std::optional<time_point> query_scheduler::due() const noexcept {
    if (asked_ >= at_once) {
        return {};
    }
    if (!fresh_.empty()) {
        return open_at();
    }
    if (schedule_.empty()) {
        return {};
    }
    return std::max(open_at(), std::get<time_point>(*schedule_.begin()));
}

query_scheduler::endpoint& query_scheduler::at(const query_target& who) {
    const auto [found, made] = endpoints_.try_emplace(who.where);
    if (made) {
        found->second.number = ++last_order_;
    }
    return found->second;
}

// At a URL that failed before, nodes are asked one at a time, after a pause.
void query_scheduler::schedule(endpoint& e) {
    ++steps_;
    if (e.scheduled) {
        schedule_.erase({*e.scheduled, e.number, &e});
        e.scheduled.reset();
    }
    if (!e.waiting.empty() && e.has_room()) {
        e.scheduled = std::max(e.closed_until, std::get<time_point>(*e.waiting.begin()));
        schedule_.emplace(*e.scheduled, e.number, &e);
    }
}

void query_scheduler::release(const query_target& who) {
    const auto found = endpoints_.find(who.where);
    schedule(found->second);
    if (found->second.is_idle()) {
        endpoints_.erase(found);
    }
}

void query_scheduler::forget_idle(time_point now) {
    if (endpoints_.size() < max_endpoints_before_tidying) {
        return;
    }
    steps_ += endpoints_.size();
    std::erase_if(endpoints_, [now](const auto& entry) {
        const auto& e = entry.second;
        return e.asking == 0 && e.waiting.empty() && e.closed_until + max_pause <= now;
    });
}

} // namespace cles::core
