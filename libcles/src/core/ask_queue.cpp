// SPDX-License-Identifier: BSL-1.0
#include "core/ask_queue.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

// At the rate of failures that there may be, no more are worth remembering for as long as their longest pause takes.
constexpr std::size_t most_endpoints_before_tidying = 8'192;

std::chrono::milliseconds pause_after(unsigned failures) noexcept {
    constexpr unsigned most_doublings = 5;
    return std::min(ask_queue::first_pause * (1 << std::min(failures - 1, most_doublings)), ask_queue::longest_pause);
}

} // namespace

void ask_queue::enter(inquiry& who) {
    if (who.at_ == inquiry::place::nowhere) {
        who.at_ = inquiry::place::fresh;
        who.order_ = ++last_order_;
        fresh_.emplace(who.order_, &who);
    }
}

void ask_queue::wait(inquiry& who, time_point turn) {
    auto& e = at(who);
    who.at_ = inquiry::place::waiting;
    who.turn_ = turn;
    who.order_ = ++last_order_;
    e.waiting.emplace(who.turn_, who.order_, &who);
    schedule(e);
}

void ask_queue::remove(inquiry& who) {
    const auto was = std::exchange(who.at_, inquiry::place::nowhere);
    if (was == inquiry::place::fresh) {
        fresh_.erase(who.order_);
    } else if (was == inquiry::place::waiting) {
        at(who).waiting.erase({who.turn_, who.order_, &who});
        release(who);
    } else if (was == inquiry::place::asked) {
        --asked_;
        --at(who).asking;
        release(who);
    }
}

inquiry* ask_queue::next(time_point now) {
    if (asked_ >= at_once || now < open_at()) {
        return nullptr;
    }
    newest_next_ = !newest_next_;
    if (newest_next_) {
        auto* found = newest_fresh(now);
        return found != nullptr ? found : take_waiting(now);
    }
    auto* found = take_waiting(now);
    return found != nullptr ? found : oldest_fresh(now);
}

inquiry* ask_queue::newest_fresh(time_point now) {
    while (!fresh_.empty()) {
        if (auto* found = take_fresh(*fresh_.rbegin()->second, now)) {
            return found;
        }
    }
    return nullptr;
}

inquiry* ask_queue::oldest_fresh(time_point now) {
    while (!fresh_.empty()) {
        if (auto* found = take_fresh(*fresh_.begin()->second, now)) {
            return found;
        }
    }
    return nullptr;
}

// Null where its URL is known to be dead: then it waits there with the others.
inquiry* ask_queue::take_fresh(inquiry& who, time_point now) {
    ++steps_;
    fresh_.erase(who.order_);
    auto& e = at(who);
    if (e.failures != 0) {
        wait(who, now);
        return nullptr;
    }
    count_as_asked(who, e);
    return &who;
}

inquiry* ask_queue::take_waiting(time_point now) {
    if (schedule_.empty() || std::get<time_point>(*schedule_.begin()) > now) {
        return nullptr;
    }
    ++steps_;
    auto& e = *std::get<endpoint*>(*schedule_.begin());
    auto& who = *std::get<inquiry*>(*e.waiting.begin());
    e.waiting.erase(e.waiting.begin());
    count_as_asked(who, e);
    return &who;
}

void ask_queue::count_as_asked(inquiry& who, endpoint& e) {
    who.at_ = inquiry::place::asked;
    ++asked_;
    ++e.asking;
    schedule(e);
}

void ask_queue::answered(inquiry& who) {
    at(who).failures = 0;
    at(who).closed_until = time_point::min();
    who.failures = 0;
    remove(who);
}

void ask_queue::failed(inquiry& who, bool unreachable, time_point now) {
    forget_idle(now);
    debt_ = std::max(debt_, now) + per_failure;
    ++who.failures;
    auto& e = at(who);
    // Of several that were asked there at once, the first to fail counts.
    if (unreachable && e.closed_until <= now) {
        ++e.failures;
        e.closed_until = now + pause_after(e.failures);
    }
    --asked_;
    --e.asking;
    wait(who, now + pause_after(who.failures));
}

std::optional<time_point> ask_queue::due() const noexcept {
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

ask_queue::endpoint& ask_queue::at(const inquiry& who) {
    const auto [found, made] = endpoints_.try_emplace(who.where);
    if (made) {
        found->second.number = ++last_order_;
    }
    return found->second;
}

// Where it failed before, one at a time is asked, after a pause.
void ask_queue::schedule(endpoint& e) {
    ++steps_;
    if (e.scheduled) {
        schedule_.erase({*e.scheduled, e.number, &e});
        e.scheduled.reset();
    }
    if (!e.waiting.empty() && (e.failures == 0 || e.asking == 0)) {
        e.scheduled = std::max(e.closed_until, std::get<time_point>(*e.waiting.begin()));
        schedule_.emplace(*e.scheduled, e.number, &e);
    }
}

void ask_queue::release(const inquiry& who) {
    const auto found = endpoints_.find(who.where);
    schedule(found->second);
    if (found->second.is_idle()) {
        endpoints_.erase(found);
    }
}

void ask_queue::forget_idle(time_point now) {
    if (endpoints_.size() < most_endpoints_before_tidying) {
        return;
    }
    steps_ += endpoints_.size();
    std::erase_if(endpoints_, [now](const auto& entry) {
        const auto& e = entry.second;
        return e.asking == 0 && e.waiting.empty() && e.closed_until + longest_pause <= now;
    });
}

} // namespace cles::core
