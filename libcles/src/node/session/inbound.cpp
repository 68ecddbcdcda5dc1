// SPDX-License-Identifier: BSL-1.0
#include "node/session/inbound.hpp"

#include "node/routing/router.hpp"
#include "node/security_protocol.hpp"
#include "node/session/request_checks.hpp"
#include "node/session/reserved_tasks.hpp"
#include "node/tracing/span_recorder.hpp"

#include <utility>
#include <vector>

namespace cles::core {

inbound::inbound(std::shared_ptr<node_state> host, line_sink& out, subscriber& updates, const identity& peer)
    : node_(std::move(host)), out_(out), peer_(peer), memory_(out.memory()), ordered_(*node_, out, memory_),
      replies_(*node_, out), bound_(node_, out, updates, peer, replies_) {
    if (out_.is_datagram()) {
        seen_.emplace(node_->deadlines, node_->remembered);
        replies_.remember(*seen_);
    }
}

inbound::~inbound() { lose(); }

void inbound::on_request(std::string_view line, const protocol::request_line& r, time_point now) {
    if (ending_) {
        return;
    }
    if (seen_ && !admit_datagram(r, *seen_, *node_, out_, replies_)) {
        return;
    }
    ++(is_housekeeping(r) ? node_->counts.housekeeping : node_->counts.requests[static_cast<std::size_t>(r.verb)]);
    if (r.id != 0 && calls_.contains(r.id)) {
        replies_.fail(r, errc::bad_request, node_->name + ": the id " + std::to_string(r.id) + " is in flight already");
        break_off();
        return;
    }
    if (const auto id = r.verb == verb::push ? cancelled_id(r.noun) : std::nullopt) {
        serve_cancel(r, *id);
        return;
    }
    if (refuses_new_requests_) {
        refuse_in_turn(reply_target{r}, shutting_down(*node_));
        return;
    }
    if (r.id == 0 && ordered_.must_wait()) {
        const bool too_many = in_flight() >= node_->bounds.in_flight;
        if (too_many || !ordered_.push(line, now, r.noun.task == "cles")) {
            refuse_in_turn(reply_target{r},
                           too_many ? busy(node_->name + ": too many requests wait on this link") : no_memory(*node_));
        }
        return;
    }
    // An unbind frees resources. Refusing it would leave a binding that nobody wants.
    const bool unbinds = r.verb == verb::bind && r.unbinds();
    if (in_flight() >= node_->bounds.in_flight && !unbinds) {
        replies_.fail(r, busy(node_->name + ": too many requests are in flight on this link"));
        return;
    }
    serve(r, now, now);
}

void inbound::on_malformed(const protocol::malformed_request& what) {
    if (ending_) {
        return;
    }
    refuse_in_turn(reply_target{what}, {.code = errc::bad_request, .message = node_->name + ": " + what.why});
    if (!seen_ && what.id != 0 && calls_.contains(what.id)) {
        break_off();
    }
}

void inbound::on_overlong(std::string_view head) {
    if (ending_) {
        return;
    }
    refuse_in_turn(reply_target{protocol::salvage(head)}, overlong(*node_, out_.datagram()));
    if (!seen_) { // datagrams are independent of each other
        closing_ = true;
        end();
    }
}

void inbound::end() {
    ending_ = true;
    while (!calls_.empty()) {
        withdraw(calls_.begin()->first);
    }
    finish_if_done();
}

void inbound::break_off() {
    lose();
    ending_ = closing_ = true;
    finish_if_done();
}

void inbound::lose() {
    lost_ = true;
    if (node_->secured) {
        node_->secured->forget(peer_);
    }
    auto calls = std::exchange(calls_, {});
    const auto anonymous = ordered_.clear();
    const auto detach = [this](call& c) {
        c.detach();
        if (const auto& trace = c.wanted().trace; trace.sampled && node_->spans) {
            node_->spans->end(trace.span, wire_name(errc::cancelled), node_->time.now());
        }
    };
    for (auto& [id, c] : calls) {
        detach(*c);
    }
    if (anonymous) {
        detach(*anonymous);
    }
    bound_.clear();
    if (anonymous) {
        anonymous->stop();
    }
    for (auto& [id, c] : calls) {
        c->stop();
    }
}

// The link ends before waiting requests could be served: they are answered now.
void inbound::abort_running() {
    refuses_new_requests_ = true;
    auto running = std::vector<std::shared_ptr<call>>{};
    for (const auto& [id, c] : calls_) {
        running.push_back(c);
    }
    if (ordered_.running()) {
        running.push_back(ordered_.running());
    }
    for (const auto& c : running) {
        if (!c->ended()) {
            c->abort({.code = errc::unavailable, .message = node_->name + " shut down before the request had ended"});
        }
    }
    while (has_more() && !ordered_.is_serving()) {
        serve_more(node_->time.now());
    }
}

void inbound::finish_if_done() {
    if (ending_ && !finished_ && !ordered_.must_wait() && (closing_ || bound_.empty())) {
        finished_ = true;
        out_.finish();
    }
}

// -- requests without an id run one after another ------------------------------------------------------------------

void inbound::refuse_in_turn(reply_target where, const protocol::failure& why) {
    if (must_wait(where)) {
        ordered_.push_reply(failure_text(why));
    } else {
        replies_.fail(where, why);
    }
}

void inbound::serve_more(time_point now) {
    if (!ordered_.is_serving()) {
        ordered_.serve([&](const protocol::request_line& r, time_point arrived) { serve(r, arrived, now); });
        finish_if_done();
    }
}

// -- serving -------------------------------------------------------------------------------------------------------

void inbound::serve(const protocol::request_line& r, time_point arrived, time_point now) {
    if (r.trace.sampled && node_->spans) {
        serve_traced(r, arrived, now);
    } else {
        serve_admitted(r, arrived, now);
    }
}

// From here on, the request's parent is the span of this node.
void inbound::serve_traced(const protocol::request_line& r, time_point arrived, time_point now) {
    auto traced = r;
    traced.trace = node_->spans->receive(r, arrived, now);
    serve_admitted(traced, arrived, now);
}

void inbound::serve_admitted(const protocol::request_line& r, time_point arrived, time_point now) {
    const auto due = saturating_add(arrived, std::chrono::milliseconds{r.deadline_ms});
    if (now >= due) {
        replies_.fail(r, errc::deadline, node_->name + ": the deadline passed while the request was queued");
        return;
    }
    if (refuses_new_requests_) {
        replies_.fail(r, shutting_down(*node_));
        return;
    }
    if (const auto why = refusal_reason(*node_, peer_, r);
        why || lost_) { // lost: the access rules, which are user code, closed the link
        replies_.fail(r, why.value_or(protocol::failure{.code = errc::unavailable, .message = {}}));
        return;
    }
    if (is_local_target(*node_, r)) {
        serve_locally(r, due, now);
    } else if (r.verb == verb::bind) {
        bound_.serve_remote(r, due, now, *this);
        finish_if_done();
    } else if (!node_->active_router->route(r, peer_, due, now, *this)) {
        if (lost_) { // by user code that reports the load
            replies_.fail(r, protocol::failure{.code = errc::unavailable, .message = {}});
        } else {
            serve_locally(r, due, now);
        }
    }
}

void inbound::serve_locally(const protocol::request_line& r, time_point due, time_point now) {
    if (r.noun.task == "cles") {
        serve_reserved(*node_, replies_, r, peer_);
    } else if (r.verb == verb::bind) {
        bound_.serve(r, due, now, *this);
        finish_if_done();
    } else {
        auto storage = std::exchange(decoded_, {}); // the handler may cause other requests to be served meanwhile
        task_execution{node_, r, peer_, due, now, storage}.run(*this, memory_);
        constexpr std::size_t kept = 4096;
        if (storage.capacity() <= kept) {
            decoded_ = std::move(storage);
        }
    }
}

// Takes effect at once, however much is in flight. Without an id, the reply still waits its turn.
void inbound::serve_cancel(const protocol::request_line& r, std::uint64_t id) {
    const reply_target where{r};
    if (const auto why = refusal_reason(*node_, peer_, r)) {
        refuse_in_turn(where, *why);
        return;
    }
    withdraw(id);
    if (must_wait(where)) {
        ordered_.push_reply("{}");
    } else {
        replies_.done(where, {});
    }
}

void inbound::withdraw(std::uint64_t id) {
    const auto found = calls_.find(id);
    if (found != calls_.end()) {
        const auto c = found->second;
        c->abort({.code = errc::cancelled, .message = node_->name + ": the requester cancelled it"});
    }
}

std::shared_ptr<call> inbound::make_call(const protocol::request_line& r, time_point due, time_point now) {
    if (lost_) {
        replies_.fail(r, protocol::failure{.code = errc::unavailable, .message = {}});
        return nullptr;
    }
    if (const auto why = no_capacity_to_run(*node_)) {
        replies_.fail(r, *why);
        return nullptr;
    }
    call::terms wanted{r};
    wanted.routed = true;
    auto c = call::begin(node_, *this, std::move(wanted), memory_, r.text.size(), due, now);
    if (c) {
        keep(r, c);
    } else {
        replies_.fail(r, no_memory(*node_));
    }
    return c;
}

void inbound::keep(const protocol::request_line& r, const std::shared_ptr<call>& c) {
    if (r.id == 0) {
        ordered_.set_running(c);
        return;
    }
    if (seen_ && (r.verb == verb::pull || r.verb == verb::bind)) {
        seen_->add_repeatable(r.id, r.text);
    }
    calls_.emplace(r.id, c);
}

void inbound::forget(const call& c) {
    out_.wake();
    if (c.wanted().id != 0) {
        calls_.erase(c.wanted().id);
    } else {
        // The next request without an id starts in the link's next pass. A call may end while the library iterates over
        // its own containers; a handler started there could change them, or destroy the service.
        ordered_.set_running(nullptr);
        finish_if_done();
    }
}

// -- outcomes ------------------------------------------------------------------------------------------------------

void inbound::write_result(task_execution& task) {
    replies_.write(task.line(), [&](json_writer& w) { task.write(w); });
}

// If this node refuses a request for `any` before starting it, another node may serve it.
void inbound::refuse(const task_execution& task, const protocol::failure& why) {
    const auto& r = task.line();
    if (may_have_started(why) || node_->active_router == nullptr || is_local_target(*node_, r)) {
        replies_.fail(r, why);
    } else {
        node_->active_router->continue_after_busy(r, peer_, why, task.due(), task.now(), *this);
    }
}

void inbound::answer(const call& c, std::string_view json) {
    replies_.done(reply_target{c.wanted()}, json, c.head());
    forget(c);
}

void inbound::refuse(const call& c, const protocol::failure& why) {
    replies_.fail(reply_target{c.wanted()}, why);
    forget(c);
}

bool inbound::report(const call& c, double fraction, std::string_view json) {
    if (c.wanted().id == 0) {
        return false;
    }
    if (!out_.is_behind()) { // else the next report supersedes it
        replies_.progress(reply_target{c.wanted()}, fraction, json);
        out_.wake();
    }
    return true;
}

} // namespace cles::core
