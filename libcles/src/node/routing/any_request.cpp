// SPDX-License-Identifier: BSL-1.0
#include "node/routing/any_request.hpp"

#include "node/base/deadlines.hpp"
#include "node/routing/subrequest.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace cles::core {
namespace {

// How long an unreachable node is avoided; `membership` removes those that are gone.
constexpr std::chrono::milliseconds out_of_reach{1'000};

std::chrono::milliseconds pause_after(const subrequest_failure& why) {
    if (why.unreachable) {
        return out_of_reach;
    }
    return std::chrono::milliseconds{
        std::min<std::uint64_t>(why.told.retry_ms.value_or(protocol::default_retry_ms), 1'000)};
}

} // namespace

any_request::any_request(std::shared_ptr<request_router> by, const protocol::request_line& r, const identity& peer,
                         std::shared_ptr<call> answers, time_point due)
    : routing_(std::move(by)), request_(r), peer_(peer), call_(std::move(answers)), due_(due) {}

bool any_request::begin(time_point now) {
    if (retry_after_) {
        ask_another(now);
        return true;
    }
    if (routing_->waits_for_discovery()) {
        return false;
    }
    const auto chosen = routing_->choose(*request_, asked_, now);
    if (over()) { // the program's load function has stopped the service
        return true;
    }
    if (!chosen.nobody()) {
        ask(chosen, now);
        return true;
    }
    if (routing_->expects_more()) {
        return false;
    }
    call_->fail(routing_->no_provider(*request_));
    return true;
}

void any_request::ask(const load_balancer::chosen& chosen, time_point now) {
    idempotent_ = chosen.idempotent || request_->verb == verb::pull;
    known_ = chosen.other != nullptr;
    if (asked_.empty()) {
        follow_stop();
    }
    if (known_) {
        auto& other = *chosen.other;
        asked_.push_back(other.name);
        ++other.given;
        ticket_ = send_subrequest(routing_->out(), *request_, other.name,
                                  forwarded_adverbs(*request_, routing_->host().name), due_, shared_from_this(), 0);
        return;
    }
    asked_.push_back(routing_->host().name);
    here_ = std::make_unique<local_request>(routing_->shared_host(), shared_from_this(), 0, call_->memory());
    here_->run(*request_, peer_, due_, now);
}

void any_request::continue_after_local_refusal(const protocol::failure& why) {
    follow_stop();
    asked_.push_back(routing_->host().name);
    on_failure(0, {.told = why, .may_have_started = false, .unreachable = false});
}

void any_request::follow_stop() {
    call_->on_stop([weak = weak_from_this()] {
        if (const auto self = weak.lock()) {
            self->stop();
        }
    });
}

void any_request::stop() {
    const auto self = shared_from_this();
    if (here_) {
        here_->withdraw();
    } else if (ticket_ != 0 && !routing_->stopped()) {
        routing_->out().cancel(ticket_);
    }
}

// Updates the tracked load of the node that was asked.
void any_request::note_end(const subrequest_failure* why, time_point now) {
    const bool refused = why != nullptr && (why->unreachable || why->told.code == errc::busy);
    if (!known_) {
        if (refused) {
            routing_->avoid_local(saturating_add(now, pause_after(*why)));
        }
        return;
    }
    if (auto* other = routing_->find(asked_.back())) {
        other->given -= other->given != 0 ? 1 : 0;
        other->given_at_report = std::min(other->given_at_report, other->given);
        if (refused) {
            other->avoid_until = saturating_add(now, pause_after(*why));
        }
    }
}

void any_request::on_result(std::size_t, std::string_view json) {
    const auto self = shared_from_this();
    note_end(nullptr, {});
    call_->done(json);
}

void any_request::on_progress(std::size_t, double fraction, std::string_view json) { call_->progress(fraction, json); }

bool any_request::may_repeat(const subrequest_failure& why) const noexcept {
    if (!why.may_have_started) {
        return why.unreachable || why.told.code == errc::busy || why.told.code == errc::no_task ||
               why.told.code == errc::no_target;
    }
    return why.told.code == errc::unavailable && idempotent_ && !lost_ && !why.told.ran;
}

void any_request::on_failure(std::size_t, subrequest_failure why) {
    const auto self = shared_from_this();
    if (routing_->stopped()) {
        return;
    }
    const auto now = routing_->host().time.now();
    note_end(&why, now);
    if (!call_->ended()) {
        try_next(std::move(why));
    }
}

void any_request::try_next(subrequest_failure why) {
    const auto busy = why.told.code == errc::busy;
    const bool may_have_started = why.may_have_started;
    const bool lost = may_have_started && why.told.code == errc::unavailable;
    busy_ += busy ? 1 : 0;
    const bool repeat = may_repeat(why) && busy_ < max_busy;
    auto told = named(std::move(why), asked_.back());
    if (lost && lost_) {
        told.ran = true;
        told.answer.clear(); // another node's reply does not know of the first attempt
    } else if (lost) {
        lost_ = told;
    }
    if (busy && (!last_busy_ || told.retry_ms.value_or(0) < last_busy_->retry_ms.value_or(0))) {
        last_busy_ = told;
    }
    if (!repeat) {
        give_up(std::move(told), may_have_started);
        return;
    }
    ticket_ = 0;
    retry_after_ = subrequest_failure{.told = std::move(told), .may_have_started = may_have_started};
    routing_->schedule(shared_from_this());
}

void any_request::ask_another(time_point now) {
    const auto why = *std::exchange(retry_after_, std::nullopt);
    const auto done = std::move(here_);
    const auto next = routing_->choose(*request_, asked_, now);
    if (over()) {
        return;
    }
    if (!next.nobody()) {
        ask(next, now);
    } else {
        give_up(why.told, why.may_have_started);
    }
}

void any_request::give_up(protocol::failure why, bool may_have_started) {
    // `busy` promises that the work was not started.
    if (!may_have_started && lost_) {
        why = *lost_;
    } else if (!may_have_started && last_busy_) {
        why = *last_busy_;
    }
    call_->fail(std::move(why));
}

} // namespace cles::core
