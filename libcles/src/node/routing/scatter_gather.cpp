// SPDX-License-Identifier: BSL-1.0
#include "node/routing/scatter_gather.hpp"

#include "node/routing/subrequest.hpp"
#include "node/session/request_checks.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

namespace cles::core {

scatter_gather::scatter_gather(std::shared_ptr<request_router> by, const protocol::request_line& r,
                               const identity& peer, std::shared_ptr<call> answers, time_point due)
    : routing_(std::move(by)), request_(r), peer_(peer), call_(std::move(answers)), due_(due) {}

bool scatter_gather::begin(time_point now) {
    if (begun_ || over()) {
        return true;
    }
    if (routing_->expects_more() && !has_waited_) {
        if (!armed()) {
            routing_->host().deadlines.arm(*this, stop_waiting_at(due_, now));
        }
        return false;
    }
    ask_known(now);
    return true;
}

void scatter_gather::ask_known(time_point now) {
    begun_ = true;
    routing_->host().deadlines.disarm(*this);
    const auto& r = *request_;
    if (offers(routing_->host(), r.verb, r.noun.task)) {
        parts_.push_back({.node = routing_->host().name});
    }
    if (r.hops != 0) {
        for (const auto& o : routing_->offers(r.verb, r.noun.task)) {
            if (!is_in_via(r.via, o.by->name)) {
                parts_.push_back({.node = o.by->name});
            }
        }
    }
    if (parts_.empty()) {
        call_->fail(routing_->no_provider(r));
        return;
    }
    std::sort(parts_.begin(), parts_.end(), [](const part& a, const part& b) { return a.node < b.node; });
    ask_all(now);
}

void scatter_gather::ask_all(time_point now) {
    const auto self = shared_from_this();
    answer_by_ = answer_by(due_, now);
    call_->on_stop([weak = weak_from_this()] {
        if (const auto alive = weak.lock()) {
            alive->cancel_open();
        }
    });
    routing_->host().deadlines.arm(*this, answer_by_);
    const auto adverbs = forwarded_adverbs(*request_, routing_->host().name);
    open_ = parts_.size();
    std::optional<std::size_t> own;
    for (std::size_t i = 0; i < parts_.size() && !ended_; ++i) {
        auto& p = parts_[i];
        if (p.node == routing_->host().name) {
            own = i;
        } else {
            p.ticket = send_subrequest(routing_->out(), *request_, p.node, adverbs, answer_by_, self, i);
        }
    }
    if (own && !ended_) { // last, since its handler may do anything
        auto& here = parts_[*own].here;
        here = std::make_unique<local_request>(routing_->shared_host(), self, *own, call_->memory());
        here->run(*request_, peer_, answer_by_, now);
    }
}

void scatter_gather::on_result(std::size_t which, std::string_view json) {
    const auto self = shared_from_this();
    if (ended_) {
        return;
    }
    if (!call_->hold_more(json.size())) {
        call_->fail({.code = errc::busy,
                     .message = "no memory is left for the answers of all (limits.memory)",
                     .retry_ms = 1000,
                     .ran = true});
        cancel_open();
        return;
    }
    parts_[which].result = json;
    bytes_ += json.size();
    --open_;
    follow();
}

void scatter_gather::on_failure(std::size_t which, subrequest_failure why) {
    const auto self = shared_from_this();
    if (ended_) {
        return;
    }
    parts_[which].failure = named(std::move(why), parts_[which].node);
    --open_;
    follow();
}

// The progress of one node says nothing about that of all.
void scatter_gather::on_progress(std::size_t, double, std::string_view) {}

void scatter_gather::on_deadline(time_point) {
    const auto self = shared_from_this();
    if (!begun_) { // there may always be nodes whose tasks are not known yet
        has_waited_ = true;
        routing_->schedule(self);
        return;
    }
    for (auto& p : parts_) {
        if (p.is_open()) {
            p.failure = late(p.node);
        }
    }
    finish();
}

void scatter_gather::follow() {
    if (ended_) {
        return;
    }
    if (bytes_ > routing_->host().bounds.line) { // it cannot fit any more
        call_->fail({.code = errc::too_large,
                     .message = "the answers of all have more than " + std::to_string(bytes_) + " bytes",
                     .ran = true});
        cancel_open();
    } else if (open_ == 0) {
        finish();
    }
}

void scatter_gather::finish() {
    aggregate_reply text;
    for (const auto& p : parts_) {
        if (p.result) {
            text.add_result(p.node, *p.result);
        } else if (p.failure) {
            text.add_failure(p.node, *p.failure);
        }
    }
    const auto answers = call_;
    cancel_open(); // those that are late
    answers->done(text.whole());
}

void scatter_gather::cancel_open() {
    const auto self = shared_from_this();
    if (std::exchange(ended_, true)) {
        return;
    }
    routing_->host().deadlines.disarm(*this);
    for (auto& p : parts_) {
        if (p.here) {
            p.here->withdraw();
        } else if (!p.result && p.ticket != 0 && !routing_->stopped()) {
            routing_->out().cancel(p.ticket);
        }
    }
}

void aggregate_reply::begin_member(std::string& in, std::string_view node) {
    in.append(in.empty() || in.ends_with('{') ? "\"" : ",\"").append(node).append("\":"); // a name needs no escapes
}

void aggregate_reply::add_result(std::string_view node, std::string_view json) {
    begin_member(results_, node);
    results_.append(json);
}

void aggregate_reply::add_failure(std::string_view node, const protocol::failure& why) {
    begin_member(errors_, node);
    append_failure(errors_, why);
}

void aggregate_reply::add_mark(std::string_view node, const std::optional<update_mark>& mark) {
    auto& marks = marks_ ? *marks_ : marks_.emplace();
    if (mark) {
        begin_member(marks, node);
        marks.append(R"({"seq":)").append(std::to_string(mark->seq));
        marks.append(R"(,"epoch":")").append(protocol::epoch_text(mark->epoch)).append("\"}");
    }
}

std::string aggregate_reply::whole() const {
    auto text = results_ + R"(},"errors":{)" + errors_ + "}";
    if (marks_) {
        text.append(R"(,"marks":{)").append(*marks_).append("}");
    }
    return text + "}";
}

time_point answer_by(time_point due, time_point now) {
    constexpr std::chrono::milliseconds most{50};
    return due - std::min<time_point::duration>((due - now) / 8, most);
}

time_point stop_waiting_at(time_point due, time_point now) {
    constexpr std::chrono::seconds most{1};
    return now + std::min<time_point::duration>((due - now) / 2, most);
}

protocol::failure late(std::string_view node) {
    return {.code = errc::deadline, .message = std::string{node} + " did not answer in time"};
}

} // namespace cles::core
