// SPDX-License-Identifier: BSL-1.0
#include "core/any_request.hpp"

#include "core/forwarding.hpp"
#include "core/later.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace cles::core {
namespace {

// How long a node is left alone that could not be reached; presence tells of those that are gone.
constexpr std::chrono::milliseconds out_of_reach{1'000};

std::chrono::milliseconds pause_after(const leg_failure& why) {
    if (why.unreachable) {
        return out_of_reach;
    }
    return std::chrono::milliseconds{
        std::min<std::uint64_t>(why.told.retry_ms.value_or(protocol::default_retry_ms), 1'000)};
}

} // namespace

any_request::any_request(std::shared_ptr<routing> by, const protocol::request_line& r, const identity& peer,
                         std::shared_ptr<call> answers, time_point due)
    : routing_(std::move(by)), request_(r), peer_(peer), call_(std::move(answers)), due_(due) {}

bool any_request::begin(time_point now) {
    if (going_on_) {
        ask_another(now);
        return true;
    }
    if (routing_->is_held()) {
        return false;
    }
    const auto chosen = routing_->choose(*request_, asked_, now);
    if (over()) { // the program was asked for its load, and has stopped the service
        return true;
    }
    if (!chosen.nobody()) {
        ask(chosen, now);
        return true;
    }
    if (routing_->expects_more()) {
        return false;
    }
    call_->fail(routing_->nobody_offers(*request_));
    return true;
}

void any_request::ask(const chooser::chosen& chosen, time_point now) {
    idempotent_ = chosen.idempotent || request_->verb == verb::pull;
    known_ = chosen.other != nullptr;
    if (asked_.empty()) {
        follow_stop();
    }
    if (known_) {
        auto& other = *chosen.other;
        asked_.push_back(other.name);
        ++other.given;
        ticket_ = send_onward(routing_->out(), *request_, other.name, onward_adverbs(*request_, routing_->host().name),
                              due_, shared_from_this(), 0);
        return;
    }
    asked_.push_back(routing_->host().name);
    here_ = std::make_unique<local_request>(routing_->shared_host(), shared_from_this(), 0);
    here_->run(*request_, peer_, due_, now);
}

void any_request::go_on_from_here(const protocol::failure& why) {
    follow_stop();
    asked_.push_back(routing_->host().name);
    on_failure(0, {.told = why, .begun = false, .unreachable = false});
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
        routing_->out().withdraw(ticket_);
    }
}

// The load of whom was asked, as this node knows it.
void any_request::note_end(const leg_failure* why, time_point now) {
    const bool refused = why != nullptr && (why->unreachable || why->told.code == errc::busy);
    if (!known_) {
        if (refused) {
            routing_->avoid_here(later(now, pause_after(*why)));
        }
        return;
    }
    if (auto* other = routing_->find(asked_.back())) {
        other->given -= other->given != 0 ? 1 : 0;
        other->told_of = std::min(other->told_of, other->given);
        if (refused) {
            other->avoid_until = later(now, pause_after(*why));
        }
    }
}

void any_request::on_result(std::size_t, std::string_view json) {
    const auto self = shared_from_this();
    note_end(nullptr, {});
    call_->done(json);
}

void any_request::on_progress(std::size_t, double fraction, std::string_view json) { call_->progress(fraction, json); }

bool any_request::may_repeat(const leg_failure& why) const noexcept {
    if (!why.begun) {
        return why.unreachable || why.told.code == errc::busy || why.told.code == errc::no_task ||
               why.told.code == errc::no_target;
    }
    return why.told.code == errc::unavailable && idempotent_ && !lost_ && !why.told.ran;
}

void any_request::on_failure(std::size_t, leg_failure why) {
    const auto self = shared_from_this();
    if (routing_->stopped()) {
        return;
    }
    const auto now = routing_->host().time.now();
    note_end(&why, now);
    if (!call_->ended()) {
        go_on(std::move(why));
    }
}

void any_request::go_on(leg_failure why) {
    const auto busy = why.told.code == errc::busy;
    const auto begun = why.begun;
    const bool lost = begun && why.told.code == errc::unavailable;
    busy_ += busy ? 1 : 0;
    const bool repeat = may_repeat(why) && busy_ < most_busy;
    auto told = named(std::move(why), asked_.back());
    if (lost && lost_) {
        told.ran = true;
        told.answer.clear(); // another node's words do not know of the first time
    } else if (lost) {
        lost_ = told;
    }
    if (busy && (!last_busy_ || told.retry_ms.value_or(0) < last_busy_->retry_ms.value_or(0))) {
        last_busy_ = told;
    }
    if (!repeat) {
        give_up(std::move(told), begun);
        return;
    }
    ticket_ = 0;
    going_on_ = leg_failure{.told = std::move(told), .begun = begun};
    routing_->begin_soon(shared_from_this());
}

void any_request::ask_another(time_point now) {
    const auto why = *std::exchange(going_on_, std::nullopt);
    const auto done = std::move(here_);
    const auto next = routing_->choose(*request_, asked_, now);
    if (over()) {
        return;
    }
    if (!next.nobody()) {
        ask(next, now);
    } else {
        give_up(why.told, why.begun);
    }
}

void any_request::give_up(protocol::failure why, bool begun) {
    // Busy promises that the work was not begun.
    if (!begun && lost_) {
        why = *lost_;
    } else if (!begun && last_busy_) {
        why = *last_busy_;
    }
    call_->fail(std::move(why));
}

} // namespace cles::core
