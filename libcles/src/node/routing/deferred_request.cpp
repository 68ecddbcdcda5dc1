// SPDX-License-Identifier: BSL-1.0
#include "node/routing/deferred_request.hpp"

#include <cles/json_reader.hpp>

#include "json/json_members.hpp"
#include "node/routing/load_balancer.hpp"
#include "node/routing/other_pools.hpp"
#include "node/session/request_checks.hpp"

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
        std::min<std::uint64_t>(why.reported.retry_ms.value_or(protocol::default_retry_ms), 1'000)};
}

// The other pools that serve this request too. One that comes from another pool, or from a program that uses NATS, is
// for this one; and what nodes say of themselves is asked of each pool by itself.
std::vector<other_pools::known_pool> other_pools_for(const node_state& host, const protocol::request_line& r,
                                                     const identity& peer) {
    return host.pools && peer.transport != "pool" && r.hops != 0 && r.noun.task != "cles"
               ? host.pools->list()
               : std::vector<other_pools::known_pool>{};
}

} // namespace

void deferred_request::follow_call() {
    call_->on_stop([weak = weak_from_this()] {
        if (const auto self = weak.lock()) {
            self->withdraw();
        }
    });
}

client_request::client_request(std::shared_ptr<request_router> by, const protocol::request_line& r,
                               const identity& peer, std::shared_ptr<call> answers, time_point due)
    : deferred_request(std::move(by), std::move(answers), due), request_(r), peer_(peer),
      origin_(origin_of(routing_->host(), peer, r)) {}

// -- any ------------------------------------------------------------------------------------------------------------

bool any_request::begin(time_point now) {
    if (!retry_after_ && routing_->waits_for_discovery()) {
        return false;
    }
    const auto chosen = busy_ < max_busy ? routing_->choose(*request_, origin_, asked_, now) : load_balancer::chosen{};
    if (over()) { // the program's load function has stopped the service
        return true;
    }
    if (!chosen.nobody()) {
        ask(chosen, now);
        return true;
    }
    if (!retry_after_ && !chosen.not_forwarded && routing_->expects_more()) {
        return false;
    }
    if (auto pool = next_pool(); !pool.empty()) {
        idempotent_ = request_->verb == verb::pull; // of a task there, that is not known
        ask_other(std::move(pool));
        return true;
    }
    if (!retry_after_ && !chosen.not_forwarded && routing_->expects_nodes()) {
        return false;
    }
    if (retry_after_) {
        give_up(retry_after_->reported, retry_after_->may_have_started);
    } else if (is_held_back(chosen)) {
        call_->fail(
            no_passage(routing_->host(), passage::not_forwarded, origin_, "any", request_->verb, request_->noun.path));
    } else {
        call_->fail(routing_->no_provider(*request_));
    }
    return true;
}

void any_request::ask(const load_balancer::chosen& chosen, time_point now) {
    idempotent_ = chosen.idempotent || request_->verb == verb::pull;
    if (chosen.other != nullptr) {
        ++chosen.other->given;
        ask_other(chosen.other->name);
        return;
    }
    note_asked(routing_->host().name);
    part_.here = std::make_unique<local_request>(call_->host(), outcome(), call_->memory(), progress_to(call_));
    part_.here->run(*request_, peer_, reply_due_, now);
}

void any_request::ask_other(std::string node) {
    note_asked(std::move(node));
    part_.ticket = routing_->send(*request_, origin_, asked_.back(), reply_due_, outcome(), progress_to(call_));
}

void any_request::note_asked(std::string node) {
    if (asked_.empty()) {
        follow_call();
    }
    part_ = {};
    asked_.push_back(std::move(node));
}

subrequest_outcome any_request::outcome() {
    return [this, self = shared_from_this()](std::string_view json, subrequest_failure* why) { on_outcome(json, why); };
}

// "north.any" of a pool that was not asked; empty if all were.
std::string any_request::next_pool() const {
    const auto& r = *request_;
    for (const auto& pool : other_pools_for(routing_->host(), r, peer_)) {
        auto target = pool.name + ".any";
        if (pool.live && std::find(asked_.begin(), asked_.end(), target) == asked_.end() &&
            may_pass_on(routing_->host(), origin_, target, r.verb, r.noun) == passage::permitted) {
            return target;
        }
    }
    return {};
}

// Whether nobody is asked only because this node may not forward for the requester.
bool any_request::is_held_back(const load_balancer::chosen& chosen) const {
    return chosen.not_forwarded || (!may_forward_for(routing_->host(), origin_.requester) &&
                                    !other_pools_for(routing_->host(), *request_, peer_).empty());
}

void any_request::continue_after_local_refusal(const protocol::failure& why) {
    note_asked(routing_->host().name);
    subrequest_failure failure{.reported = why, .may_have_started = false};
    on_outcome({}, &failure);
}

void any_request::on_outcome(std::string_view json, subrequest_failure* why) {
    if (why != nullptr && routing_->stopped()) {
        return;
    }
    note_end(why);
    if (why == nullptr) {
        call_->done(json);
    } else if (!over()) {
        try_next(std::move(*why));
    }
}

// Updates the tracked load of the node that was asked.
void any_request::note_end(const subrequest_failure* why) {
    const bool refused = why != nullptr && (why->unreachable || why->reported.code == errc::busy);
    const auto until = refused ? saturating_add(routing_->host().time.now(), pause_after(*why)) : time_point{};
    if (asked_.back() == routing_->host().name) {
        if (refused) {
            routing_->avoid_local(until);
        }
    } else if (auto* other = routing_->find(asked_.back())) {
        other->given -= other->given != 0 ? 1 : 0;
        other->given_at_report = std::min(other->given_at_report, other->given);
        if (refused) {
            other->avoid_until = until;
        }
    }
}

bool any_request::may_repeat(const subrequest_failure& why) const noexcept {
    if (!why.may_have_started) {
        return why.unreachable || why.reported.code == errc::busy || why.reported.code == errc::no_task ||
               why.reported.code == errc::no_target;
    }
    return why.reported.code == errc::unavailable && idempotent_ && !lost_ && !why.reported.ran;
}

void any_request::try_next(subrequest_failure why) {
    const auto busy = why.reported.code == errc::busy;
    const bool may_have_started = why.may_have_started;
    const bool lost = may_have_started && why.reported.code == errc::unavailable;
    busy_ += busy ? 1 : 0;
    const bool repeat = may_repeat(why) && (busy_ < max_busy || !next_pool().empty());
    auto reported = named(std::move(why), asked_.back());
    if (lost && lost_) {
        reported.ran = true;
        reported.answer.clear(); // another node's reply does not know of the first attempt
    } else if (lost) {
        lost_ = reported;
    }
    if (busy && (!last_busy_ || reported.retry_ms.value_or(0) < last_busy_->retry_ms.value_or(0))) {
        last_busy_ = reported;
    }
    if (!repeat) {
        give_up(std::move(reported), may_have_started);
        return;
    }
    part_.ticket = 0;
    retry_after_ = subrequest_failure{.reported = std::move(reported), .may_have_started = may_have_started};
    routing_->schedule(shared_from_this());
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

// -- all ------------------------------------------------------------------------------------------------------------

bool scatter_gather::begin(time_point now) {
    if (begun_ || over()) {
        return true;
    }
    if (routing_->expects_more() && !has_waited_) {
        if (!armed()) {
            routing_->host().deadlines.arm(*this, stop_waiting_at(reply_due_, now));
        }
        return false;
    }
    return ask_known(now);
}

bool scatter_gather::ask_known(time_point now) {
    routing_->host().deadlines.disarm(*this);
    const auto& r = *request_;
    const auto& host = routing_->host();
    if (offers(host, r.verb, r.noun.task) && permits(host, origin_, host.name, r.verb, r.noun)) {
        parts_.emplace_back().node = host.name;
    }
    if (r.hops != 0) {
        for (const auto& o : routing_->offers(r.verb, r.noun.task)) {
            if (!is_in_via(r.via, o.by->name)) {
                add(o.by->name);
            }
        }
    }
    if (parts_.empty() && r.hops != 0 && routing_->expects_more()) {
        return false;
    }
    add_pools();
    if (parts_.empty() && routing_->expects_nodes()) {
        return false;
    }
    begun_ = true;
    if (parts_.empty()) {
        call_->fail(routing_->no_provider(r));
        return true;
    }
    std::sort(parts_.begin(), parts_.end(), [](const part& a, const part& b) { return a.node < b.node; });
    ask_all(now);
    return true;
}

// Another node, or "north.all" of a pool. Null if the requester may not ask it. If this node may not forward for the
// requester, the reply says so.
scatter_gather::part* scatter_gather::add(std::string node) {
    const auto& r = *request_;
    const auto found = may_pass_on(routing_->host(), origin_, node, r.verb, r.noun);
    if (found == passage::not_permitted) {
        return nullptr;
    }
    auto& added = parts_.emplace_back();
    added.node = std::move(node);
    if (found != passage::permitted) {
        added.failure = no_passage(routing_->host(), found, origin_, added.node, r.verb, r.noun.path);
    }
    return &added;
}

void scatter_gather::add_pools() {
    for (auto& pool : other_pools_for(routing_->host(), *request_, peer_)) {
        if (auto* const added = add(pool.name + ".all")) {
            added->pool = std::move(pool.name);
            if (!added->failure && !pool.live) {
                added->failure = protocol::failure{.code = errc::unavailable,
                                                   .message = added->pool + " has no bridge that can be reached"};
            }
        }
    }
}

void scatter_gather::ask_all(time_point now) {
    follow_call();
    const auto by = answer_by(reply_due_, now);
    routing_->host().deadlines.arm(*this, by);
    const auto then = [this, self = shared_from_this()](part& at) {
        return [this, self, &at](std::string_view json, subrequest_failure* why) { on_outcome(at, json, why); };
    };
    auto marked = *request_; // for nodes that share their jobs; a pool asks its nodes itself
    std::string via;
    if (marked.verb == verb::delegate) {
        via = via_of_part(request_->via);
        marked.via = via;
    }
    part* own = nullptr;
    for (auto at = parts_.begin(); at != parts_.end() && !ended_; ++at) {
        if (at->node == routing_->host().name) {
            own = &*at;
        } else if (at->is_open()) {
            at->ticket = routing_->send(at->pool.empty() ? marked : *request_, origin_, at->node, by, then(*at));
        }
    }
    if (own != nullptr && !ended_) { // last, since its handler may do anything
        own->here = std::make_unique<local_request>(call_->host(), then(*own), call_->memory());
        own->here->run(*request_, peer_, by, now);
    }
    if (!ended_) {
        follow(); // if nothing had to be asked
    }
}

void scatter_gather::on_outcome(part& at, std::string_view json, subrequest_failure* why) {
    if (ended_) {
        return;
    }
    if (why != nullptr) {
        at.failure = named(std::move(*why), at.node);
    } else if (call_->hold_more(json.size())) {
        at.result = json;
        bytes_ += json.size();
    } else {
        call_->fail({.code = errc::busy,
                     .message = "no memory is left for the answers of all (limits.memory)",
                     .retry_ms = 1000,
                     .ran = true});
        withdraw();
        return;
    }
    follow();
}

void scatter_gather::on_deadline(time_point) {
    const auto self = shared_from_this();
    if (begun_) {
        finish();
    } else { // there may always be nodes whose tasks are not known yet
        has_waited_ = true;
        routing_->schedule(self);
    }
}

void scatter_gather::follow() {
    if (bytes_ > routing_->host().bounds.line) { // it cannot fit any more
        call_->fail({.code = errc::too_large,
                     .message = "the answers of all have more than " + std::to_string(routing_->host().bounds.line) +
                                " bytes (limits.line)",
                     .ran = true});
        withdraw();
    } else if (std::none_of(parts_.begin(), parts_.end(), [](const part& p) { return p.is_open(); })) {
        finish();
    }
}

void scatter_gather::finish() {
    aggregate_reply text;
    for (const auto& p : parts_) {
        if (p.pool.empty()) {
            text.add(p.node, p);
        } else {
            text.add_pool(p.pool, p);
        }
    }
    withdraw(); // those that are late
    if (text.is_empty()) {
        call_->fail(routing_->no_provider(*request_));
    } else {
        call_->done(text.whole());
    }
}

void scatter_gather::withdraw() {
    if (std::exchange(ended_, true)) {
        return;
    }
    routing_->host().deadlines.disarm(*this);
    for (const auto& p : parts_) {
        if (p.is_open()) {
            routing_->cancel(p);
        }
    }
}

// -- the reply -----------------------------------------------------------------------------------------------------

void aggregate_reply::add(std::string_view node, const node_outcome& found) {
    if (!found.result) {
        const protocol::failure late{.code = errc::deadline, .message = std::string{node} + " did not answer in time"};
        add_error(node, found.failure ? *found.failure : late);
        return;
    }
    if (!detail::is_valid_part(*found.result)) { // requesters could not read the answers of the others either
        add_error(
            node,
            {.code = errc::failed, .message = std::string{node} + ": the answer is nested too deeply", .ran = true});
        return;
    }
    begin_member(results_, node);
    results_.append(*found.result);
    if (found.mark) {
        begin_member(marks_, node);
        marks_.append(R"({"seq":)").append(std::to_string(found.mark->seq));
        marks_.append(R"(,"epoch":")").append(protocol::epoch_text(found.mark->epoch)).append("\"}");
    }
}

void aggregate_reply::add_error(std::string_view node, protocol::failure why) {
    if (!detail::is_valid_part(why.answer)) {
        why.answer.clear(); // its code and message are enough
    }
    begin_member(errors_, node);
    append_failure(errors_, why);
}

void aggregate_reply::add_pool(std::string_view pool, const node_outcome& found) {
    if (!found.result) {
        if (!found.failure || found.failure->code != errc::no_target || found.failure->ran) {
            add(std::string{pool}.append(".all"), found);
        }
        return;
    }
    json_reader reader{*found.result, detail::answer_depth};
    std::string_view part;
    reader.begin_object();
    while (reader.next_key(part)) {
        auto* const into = part == "results" ? &results_ : part == "errors" ? &errors_ : nullptr;
        if (into == nullptr || reader.peek() != json_reader::kind::object) {
            reader.skip();
            continue;
        }
        reader.begin_object();
        std::string_view node;
        while (reader.next_key(node)) {
            const auto name = std::string{pool}.append(".").append(node);
            std::string_view value;
            if (reader.read_raw(value) && protocol::is_name(node)) {
                begin_member(*into, name);
                into->append(value);
            }
        }
    }
}

std::string aggregate_reply::whole() const {
    auto text = R"({"results":{)" + results_ + R"(},"errors":{)" + errors_ + "}";
    if (with_marks_ && !results_.empty()) {
        text.append(R"(,"marks":{)").append(marks_).append("}");
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

} // namespace cles::core
