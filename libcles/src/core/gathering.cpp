// SPDX-License-Identifier: BSL-1.0
#include "core/gathering.hpp"

#include "core/all_answer.hpp"
#include "core/forwarding.hpp"
#include "core/request_checks.hpp"

#include <algorithm>
#include <optional>
#include <utility>

namespace cles::core {

gathering::gathering(std::shared_ptr<routing> by, const protocol::request_line& r, const identity& peer,
                     std::shared_ptr<call> answers, time_point due)
    : routing_(std::move(by)), request_(r), peer_(peer), call_(std::move(answers)), due_(due) {}

bool gathering::begin(time_point now) {
    if (begun_ || over()) {
        return true;
    }
    if (routing_->expects_more() && !has_waited_) {
        if (!armed()) {
            routing_->host().deadlines.arm(*this, stop_waiting_at(due_, now));
        }
        return false;
    }
    ask_whom_is_known(now);
    return true;
}

void gathering::ask_whom_is_known(time_point now) {
    begun_ = true;
    routing_->host().deadlines.disarm(*this);
    const auto& r = *request_;
    if (offers(routing_->host(), r.verb, r.noun.task)) {
        parts_.push_back({.node = routing_->host().name});
    }
    if (r.hops != 0) {
        for (const auto& o : routing_->offers(r.verb, r.noun.task)) {
            if (!passes(r.via, o.by->name)) {
                parts_.push_back({.node = o.by->name});
            }
        }
    }
    if (parts_.empty()) {
        call_->fail(routing_->nobody_offers(r));
        return;
    }
    std::sort(parts_.begin(), parts_.end(), [](const part& a, const part& b) { return a.node < b.node; });
    ask_all(now);
}

void gathering::ask_all(time_point now) {
    const auto self = shared_from_this();
    answer_by_ = answer_by(due_, now);
    call_->on_stop([weak = weak_from_this()] {
        if (const auto alive = weak.lock()) {
            alive->withdraw_open();
        }
    });
    routing_->host().deadlines.arm(*this, answer_by_);
    const auto adverbs = onward_adverbs(*request_, routing_->host().name);
    open_ = parts_.size();
    std::optional<std::size_t> own;
    for (std::size_t i = 0; i < parts_.size() && !ended_; ++i) {
        auto& p = parts_[i];
        if (p.node == routing_->host().name) {
            own = i;
        } else {
            p.ticket = send_onward(routing_->out(), *request_, p.node, adverbs, answer_by_, self, i);
        }
    }
    if (own && !ended_) { // last, since its handler may do anything
        auto& here = parts_[*own].here;
        here = std::make_unique<local_request>(routing_->shared_host(), self, *own);
        here->run(*request_, peer_, answer_by_, now);
    }
}

void gathering::on_result(std::size_t leg, std::string_view json) {
    const auto self = shared_from_this();
    if (ended_) {
        return;
    }
    if (!call_->hold_more(json.size())) {
        call_->fail({.code = errc::busy,
                     .message = "no memory is left for the answers of all (limits.memory)",
                     .retry_ms = 1000,
                     .ran = true});
        withdraw_open();
        return;
    }
    parts_[leg].result = json;
    bytes_ += json.size();
    --open_;
    follow();
}

void gathering::on_failure(std::size_t leg, leg_failure why) {
    const auto self = shared_from_this();
    if (ended_) {
        return;
    }
    parts_[leg].failure = named(std::move(why), parts_[leg].node);
    --open_;
    follow();
}

// How far all of them are cannot be told from one.
void gathering::on_progress(std::size_t, double, std::string_view) {}

void gathering::on_deadline(time_point) {
    const auto self = shared_from_this();
    if (!begun_) { // there are always some who have not said what they offer yet
        has_waited_ = true;
        routing_->begin_soon(self);
        return;
    }
    for (auto& p : parts_) {
        if (p.is_open()) {
            p.failure = late(p.node);
        }
    }
    finish();
}

void gathering::follow() {
    if (ended_) {
        return;
    }
    if (bytes_ > routing_->host().bounds.line) { // it will not fit, whatever follows
        call_->fail({.code = errc::too_large,
                     .message = "the answers of all have more than " + std::to_string(bytes_) + " bytes",
                     .ran = true});
        withdraw_open();
    } else if (open_ == 0) {
        finish();
    }
}

void gathering::finish() {
    all_answer text;
    for (const auto& p : parts_) {
        if (p.result) {
            text.add_result(p.node, *p.result);
        } else if (p.failure) {
            text.add_failure(p.node, *p.failure);
        }
    }
    const auto answers = call_;
    withdraw_open(); // what is late
    answers->done(text.whole());
}

void gathering::withdraw_open() {
    const auto self = shared_from_this();
    if (std::exchange(ended_, true)) {
        return;
    }
    routing_->host().deadlines.disarm(*this);
    for (auto& p : parts_) {
        if (p.here) {
            p.here->withdraw();
        } else if (!p.result && p.ticket != 0 && !routing_->stopped()) {
            routing_->out().withdraw(p.ticket);
        }
    }
}

} // namespace cles::core
