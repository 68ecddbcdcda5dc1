// SPDX-License-Identifier: BSL-1.0
#include "core/inbound.hpp"

#include "core/execution.hpp"
#include "core/handler_failure.hpp"
#include "core/later.hpp"
#include "core/progress_line.hpp"
#include "core/raised.hpp"
#include "core/refusals.hpp"
#include "core/request_checks.hpp"
#include "core/reserved_tasks.hpp"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>
#include <vector>

namespace cles::core {
namespace {

// What one turn may take of the requests that waited for each other, so that other links have theirs.
constexpr int requests_per_turn = 256;
constexpr std::size_t bytes_per_turn = 65536;

} // namespace

inbound::inbound(std::shared_ptr<node> host, outlet& out, binder& updates, const identity& peer)
    : node_(std::move(host)), out_(out), peer_(peer), memory_(out.memory()), waiting_(memory_), replies_(*node_, out),
      bound_(node_, out, updates, peer, replies_) {
    if (out_.datagram() != 0) {
        datagrams_.emplace(*node_, out_, replies_);
    }
}

inbound::~inbound() { lose(); }

void inbound::on_request(std::string_view line, const protocol::request_line& r, time_point now) {
    if (ending_) {
        return;
    }
    if (datagrams_ && !datagrams_->admit(r)) {
        return;
    }
    ++(is_housekeeping(r) ? node_->counts.housekeeping : node_->counts.requests[static_cast<std::size_t>(r.verb)]);
    if (r.id != 0 && calls_.contains(r.id)) {
        replies_.fail(r, errc::bad_request, node_->name + ": the id " + std::to_string(r.id) + " is in flight already");
        lose();
        ending_ = closing_ = true;
        finish_if_done();
        return;
    }
    if (const auto id = r.verb == verb::push ? cancelled_id(r.noun) : std::nullopt) {
        serve_cancel(r, *id, now);
        return;
    }
    if (begins_nothing_) {
        refuse_in_turn(r, shutting_down(*node_), now);
        return;
    }
    if (r.id == 0 && must_wait()) {
        const bool too_many = in_flight() >= node_->bounds.in_flight;
        if (!too_many && waiting_.push_line(line, now, r.noun.task == "cles")) {
            follow_waiting();
        } else {
            refuse_in_turn(
                r, too_many ? busy(node_->name + ": too many requests wait on this link") : no_memory(*node_), now);
        }
        return;
    }
    // An unbind takes no room and makes some: refused, it would leave a binding that nobody wants.
    const bool unbinds = r.verb == verb::bind && r.unbinds();
    if (in_flight() >= node_->bounds.in_flight && !unbinds) {
        replies_.fail(r, busy(node_->name + ": too many requests are in flight on this link"));
        return;
    }
    serve(r, now, now);
}

void inbound::on_malformed(std::string_view, const protocol::malformed_request& what, time_point now) {
    if (ending_) {
        return;
    }
    const protocol::failure why{.code = errc::bad_request, .message = node_->name + ": " + what.why};
    if (!datagrams_ && what.id != 0 && calls_.contains(what.id)) {
        replies_.fail({what.id, what.wants_reply}, why);
        lose();
        ending_ = closing_ = true;
        finish_if_done();
    } else if (what.id == 0 && what.wants_reply && must_wait()) {
        answer_in_turn(failure_text(why), now);
    } else {
        replies_.fail_apart({what.id, what.wants_reply}, why);
    }
}

void inbound::on_overlong(std::string_view head, time_point now) {
    if (ending_) {
        return;
    }
    const auto meant = protocol::salvage(head);
    const auto why = overlong(*node_, out_.datagram());
    if (meant.id == 0 && meant.wants_reply && must_wait()) {
        answer_in_turn(failure_text(why), now);
    } else {
        replies_.fail_apart({meant.id, meant.wants_reply}, why);
    }
    if (datagrams_) { // the next one has nothing to do with it
        return;
    }
    closing_ = true;
    end(now);
}

void inbound::end(time_point) {
    ending_ = true;
    withdraw_all();
    finish_if_done();
}

void inbound::withdraw_all() {
    while (!calls_.empty()) {
        withdraw(calls_.begin()->first);
    }
}

void inbound::drop_all() {
    auto calls = std::exchange(calls_, {});
    auto anonymous = std::exchange(anonymous_, nullptr);
    waiting_.clear();
    for (auto& [id, c] : calls) {
        c->detach();
    }
    if (anonymous) {
        anonymous->detach();
    }
    bound_.clear();
    if (anonymous) {
        anonymous->stop();
    }
    for (auto& [id, c] : calls) {
        c->stop();
    }
}

// What waits has no other turn before the link ends, and is not begun any more.
void inbound::cut_short() {
    begins_nothing_ = true;
    auto running = std::vector<std::shared_ptr<call>>{};
    for (const auto& [id, c] : calls_) {
        running.push_back(c);
    }
    if (anonymous_) {
        running.push_back(anonymous_);
    }
    for (const auto& c : running) {
        if (!c->ended()) {
            refuse(*c, {.code = errc::unavailable, .message = node_->name + " shut down before this had ended"});
            c->stop();
        }
    }
    while (has_more() && !serving_waiting_) {
        serve_waiting(node_->time.now());
    }
}

void inbound::finish_if_done() {
    if (ending_ && !finished_ && !must_wait() && (closing_ || bound_.empty())) {
        finished_ = true;
        out_.finish();
    }
}

// -- requests without id wait for each other -----------------------------------------------------------------------

void inbound::refuse_in_turn(const protocol::request_line& r, const protocol::failure& why, time_point now) {
    if (r.id == 0 && r.wants_reply && must_wait()) {
        answer_in_turn(failure_text(why), now);
    } else {
        replies_.fail(r, why);
    }
}

void inbound::answer_in_turn(std::string answer, time_point now) {
    waiting_.push_answer(std::move(answer), now);
    follow_waiting();
}

// A link whose requests take up too much room is not read for a while.
void inbound::follow_waiting() {
    const auto most = node_->bounds.waiting;
    const bool too_much = waiting_.bytes() > (paused_ ? most / 2 : most);
    if (too_much != paused_) {
        paused_ = too_much;
        out_.pause(too_much);
    }
}

void inbound::serve_waiting(time_point now) {
    if (serving_waiting_) {
        return;
    }
    const raised serving{serving_waiting_};
    const auto before = out_.output().size();
    int turn = requests_per_turn;
    while (has_more()) {
        if (turn-- == 0 || out_.output().size() > before + bytes_per_turn) {
            out_.wake(); // goes on after what there is has been sent
            break;
        }
        const auto next = waiting_.pop();
        if (!next.line.empty()) {
            protocol::request_line r;
            protocol::malformed_request ignored;
            protocol::parse_request(next.line, r, ignored); // was read when it came
            serve(r, next.arrived, now);
        }
        for (std::size_t i = 0; i < next.times && !next.answer.empty(); ++i) {
            out_.output().append(next.answer).push_back('\n');
            node_->counts.errors += protocol::is_failure(next.answer) ? 1 : 0;
        }
    }
    follow_waiting();
    finish_if_done();
}

// -- serving -------------------------------------------------------------------------------------------------------

void inbound::serve(const protocol::request_line& r, time_point arrived, time_point now) {
    if (now - arrived >= std::chrono::milliseconds{r.deadline_ms}) {
        replies_.fail(r, errc::deadline, node_->name + ": its time ran out while it waited for its turn");
        return;
    }
    if (begins_nothing_) {
        replies_.fail(r, shutting_down(*node_));
        return;
    }
    if (const auto why = objection(*node_, peer_, r); why || lost_) { // lost: by the access rules, a program's own code
        replies_.fail(r, why.value_or(protocol::failure{.code = errc::unavailable, .message = {}}));
        return;
    }
    if (is_for(*node_, r)) {
        serve_here(r, arrived, now);
        return;
    }
    const auto due = later(arrived, std::chrono::milliseconds{r.deadline_ms});
    if (r.verb == verb::bind) {
        bound_.serve_elsewhere(r, due, now, *this);
        finish_if_done();
    } else if (!node_->way->route(r, peer_, due, now, *this)) {
        if (lost_) { // by the program, when it was asked for its load
            replies_.fail(r, protocol::failure{.code = errc::unavailable, .message = {}});
        } else {
            serve_here(r, arrived, now);
        }
    }
}

void inbound::serve_here(const protocol::request_line& r, time_point arrived, time_point now) {
    if (r.noun.task == "cles") {
        serve_reserved(*node_, replies_, r, peer_);
    } else if (r.verb == verb::bind) {
        bound_.serve(r, later(arrived, std::chrono::milliseconds{r.deadline_ms}), now, *this);
        finish_if_done();
    } else {
        serve_task(r, arrived, now);
    }
}

// Acts when it is read, however much is in flight; without an id it is answered in its turn all the same.
void inbound::serve_cancel(const protocol::request_line& r, std::uint64_t id, time_point now) {
    const auto why = objection(*node_, peer_, r);
    if (!why) {
        withdraw(id);
    }
    if (r.id == 0 && r.wants_reply && must_wait()) {
        answer_in_turn(why ? failure_text(*why) : "{}", now);
    } else if (why) {
        replies_.fail(r, *why);
    } else {
        replies_.done(reply_to{r}, {});
    }
}

void inbound::serve_task(const protocol::request_line& r, time_point arrived, time_point now) {
    const auto due = later(arrived, std::chrono::milliseconds{r.deadline_ms});
    auto storage = std::exchange(decoded_, {}); // the handler may have other requests served meanwhile
    execution task{*node_, r, peer_, due, storage};
    if (const auto why = task.refusal(memory_.get())) {
        refuse(r, *why, due, now);
    } else if (task.is_plain()) {
        if (const auto failed = run_plain(r, task)) {
            refuse(r, *failed, due, now);
        }
    } else if (const auto c = begin_call(r, task.terms(), due, now)) {
        task.start(c);
    } else {
        refuse(r, no_memory(*node_), due, now);
    }
    release_if_large(decoded_ = std::move(storage));
}

std::optional<protocol::failure> inbound::run_plain(const protocol::request_line& r, execution& task) {
    try {
        replies_.write(r, [&](json_writer& w) { task.run(w); });
        return std::nullopt;
    } catch (...) {
        return after_run(describe(std::current_exception()));
    }
}

// What came for `any` and was not begun here may be done by another node.
void inbound::refuse(const protocol::request_line& r, const protocol::failure& why, time_point due, time_point now) {
    if (has_begun(why) || node_->way == nullptr || is_for(*node_, r)) {
        replies_.fail(r, why);
    } else {
        node_->way->go_on(r, peer_, why, due, now, *this);
    }
}

std::shared_ptr<call> inbound::begin_call(const protocol::request_line& r, call::terms wanted, time_point due,
                                          time_point now) {
    auto c = std::make_shared<call>(node_, static_cast<call_owner&>(*this), std::move(wanted), now);
    if (!c->hold(memory_, r.text.size())) {
        return nullptr;
    }
    if (r.id != 0) {
        if (datagrams_ && (r.verb == verb::pull || r.verb == verb::bind)) {
            datagrams_->begin_repeatable(r);
        }
        calls_.emplace(r.id, c);
    } else {
        anonymous_ = c;
    }
    node_->deadlines.arm(*c, due);
    return c;
}

std::shared_ptr<call> inbound::open_call(const protocol::request_line& r, time_point due, time_point now) {
    if (lost_) {
        replies_.fail(r, protocol::failure{.code = errc::unavailable, .message = {}});
        return nullptr;
    }
    if (const auto why = no_room_to_run(*node_)) {
        replies_.fail(r, *why);
        return nullptr;
    }
    auto wanted = call::terms_of(r);
    wanted.routed = true;
    auto c = begin_call(r, std::move(wanted), due, now);
    if (!c) {
        replies_.fail(r, no_memory(*node_));
    }
    return c;
}

// -- calls ---------------------------------------------------------------------------------------------------------

void inbound::withdraw(std::uint64_t id) {
    const auto found = calls_.find(id);
    if (found != calls_.end()) {
        const auto c = found->second;
        refuse(*c, {.code = errc::cancelled, .message = node_->name + ": the requester withdrew it"});
        c->stop();
    }
}

void inbound::answer(call& c, std::string_view json) {
    const auto& wanted = c.wanted();
    try {
        publish_for(*node_, wanted);
    } catch (...) {
        refuse(c, describe(std::current_exception()));
        return;
    }
    replies_.done({wanted.id, wanted.wants_reply, wanted.urgent}, json, c.head());
    detach(c);
}

void inbound::refuse(call& c, const protocol::failure& why) {
    const auto& wanted = c.wanted();
    replies_.fail({wanted.id, wanted.wants_reply, wanted.urgent}, wanted.routed ? why : after_run(why));
    detach(c);
}

void inbound::report(call& c, double fraction, std::string_view json) {
    if (out_.is_behind()) {
        return; // the next one tells more
    }
    auto& out = c.wanted().urgent ? out_.urgent_output() : out_.output();
    append_progress_line(out, c.wanted().id, fraction, json, replies_.longest());
    out_.wake();
}

void inbound::detach(call& c) {
    const auto keep = c.shared_from_this();
    const auto now = node_->time.now();
    c.detach();
    if (!c.wanted().routed) {
        node_->handler_time.record(now - c.started());
    }
    out_.wake();
    if (c.wanted().id != 0) {
        calls_.erase(c.wanted().id);
    } else {
        // Who waits for it begins in the link's next turn. A call may end where the library goes through what it holds,
        // and what a handler does there (it may destroy the service) would change that.
        anonymous_.reset();
        finish_if_done();
    }
}

} // namespace cles::core
