// SPDX-License-Identifier: BSL-1.0
#include "federation/outbound_requests.hpp"

#include <cles/json_writer.hpp>

#include "federation/carried_line.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace cles::bridging {
namespace {

using std::chrono::milliseconds;

constexpr std::chrono::seconds acknowledged_within{2};
constexpr std::chrono::seconds after_deadline{1}; // until a reply is not expected any more
// Of 2^32. Multiples of it are even, also if each second one is taken, as when requests of two kinds alternate.
constexpr std::uint32_t golden_ratio = 0x9e3779b9U;

// "car1" of "north.car1".
std::string_view without_pool(std::string_view target, std::string_view pool) {
    const bool has_it = target.size() > pool.size() + 1 && target.starts_with(pool) && target[pool.size()] == '.';
    return has_it ? target.substr(pool.size() + 1) : target;
}

// What a bridge says of a pool: replies to BIND have marks.
std::string description_of(std::string_view pool) {
    std::string text;
    json_writer w{text};
    w.begin_object();
    w.plain_key("pool");
    w.value(pool);
    w.plain_key("protocol");
    w.value(std::uint64_t{1});
    w.plain_key("features");
    w.begin_array();
    w.value(std::string_view{"mark"});
    w.end_array();
    w.end_object();
    return text;
}

} // namespace

// -- from the node -------------------------------------------------------------------------------------------------

void outbound_requests::on_line(const bridge_link& from, std::string_view line, time_point now) {
    protocol::request_line r;
    protocol::malformed_request wrong;
    if (protocol::is_reply(line) || !protocol::parse_request(line, r, wrong) || r.is_update()) {
        return; // the node itself writes these lines
    }
    if (r.noun.target == "self") {
        answer_for_itself(from, r);
    } else if (r.id != 0 && r.verb == verb::bind) { // without an id, nothing could be answered
        bind(from, r, now);
    } else if (r.id != 0) {
        publish(from, r, now);
    }
}

void outbound_requests::refuse(const bridge_link& on, std::uint64_t id, const protocol::failure& why) {
    if (id != 0) {
        out_.deliver(on, reply_line(id, protocol::failure_text(why)));
    }
}

void outbound_requests::answer_for_itself(const bridge_link& from, const protocol::request_line& r) {
    if (const auto id = r.verb == verb::push ? cancelled_number(r) : std::nullopt) {
        if (const auto number = numbers_.find(*id); number != numbers_.end()) {
            cancel(sent_.find(number->second));
        }
        feeds_.cancel(*id);
    } else if (r.verb == verb::pull && r.noun.path == "cles") { // whether replies to BIND have marks
        if (r.id != 0) {
            out_.deliver(from, reply_line(r.id, description_of(from.pool)));
        }
    } else if (r.noun.path != "cles/leaving") {
        refuse(from, r.id, {.code = errc::no_target, .message = "'self' is no node of the pool '" + from.pool + "'"});
    }
}

void outbound_requests::bind(const bridge_link& from, const protocol::request_line& r, time_point now) {
    const foreign_noun noun{.pool = from.pool,
                            .node = std::string{without_pool(r.noun.target, from.pool)},
                            .task = std::string{r.noun.task},
                            .parameters = std::string{r.noun.path.substr(r.noun.task.size())},
                            .requester = std::string{r.from},
                            .target = std::string{r.noun.target},
                            .link = from.number};
    if (protocol::is_reserved_target(noun.node)) {
        refuse(from, r.id, {.code = errc::no_target, .message = "a binding in another pool needs the name of a node"});
    } else if (r.unbinds()) {
        feeds_.unbind(noun);
        out_.deliver(from, reply_line(r.id, "{}"));
    } else {
        feeds_.bind(noun, r.id); // first, so that no update is missed after the reply
        publish(from, r, now);
    }
}

void outbound_requests::publish(const bridge_link& from, const protocol::request_line& r, time_point now) {
    const auto& pool = from.pool;
    const std::string addressee{is_secured_ ? pools_.taker_of(pool, turn_) : std::string_view{}};
    turn_ += golden_ratio;
    const auto number = ++last_number_;
    const auto made =
        sent_.emplace(number, request{.from = from,
                                      .id = r.id,
                                      .number = number,
                                      .addressee = addressee,
                                      .sent_at = now,
                                      .forgotten_at = now + milliseconds{r.deadline_ms} + after_deadline});
    numbers_.insert_or_assign(r.id, number);
    if (has_crossed(r.via)) { // a node of that name in another pool is not the one that was meant
        fail(made.first,
             {.code = errc::no_target, .message = "a request from another pool is not sent on to '" + pool + "'"});
        return;
    }
    const auto node = without_pool(r.noun.target, pool);
    const auto deadline = node == "all" ? deadline_of_all(pool, r.deadline_ms) : 0;
    auto message = pool == nats_.pool() ? message_within_pool(r, deadline) : message_of(r, nats_.pool(), deadline);
    auto subject = request_subject(pool, r.verb, node, r.noun.task);
    if (is_secured_) { // for one bridge, so that the request runs there only, however often it arrives
        if (addressee.empty()) {
            fail(made.first,
                 {.code = errc::unavailable, .message = "no bridge of the pool '" + pool + "' takes requests now"});
            return;
        }
        subject = request_subject({pool, addressee});
        message = text_of(r.verb, node, r.noun.task, message);
    }
    if (!nats_.fits(message)) {
        fail(made.first,
             {.code = errc::too_large,
              .message = "a request through NATS has at most " + std::to_string(nats_.max_message()) + " bytes here"});
        return;
    }
    ++nats_.counts().requests_sent;
    if (!nats_.publish(std::move(subject), std::move(message), reply_subject(nats_.self(), number))) {
        fail(made.first, {.code = errc::busy,
                          .message = "too much waits to be sent to NATS",
                          .retry_ms = protocol::default_retry_ms});
    }
}

// The deadline to state to all nodes of a pool, if their results are needed within `left_ms`. The pool waits for all
// until then, counted from when the request arrives. So time for the way is left: what acknowledgements of the pool
// have lately taken at most, but at least a quarter or a second. A quarter remains for the nodes.
std::uint32_t outbound_requests::deadline_of_all(std::string_view pool, std::uint32_t left_ms) const {
    constexpr milliseconds least{1'000};
    const milliseconds left{left_ms};
    const auto known = round_trips_.find(pool);
    const auto way = known == round_trips_.end() ? milliseconds{0} : std::chrono::ceil<milliseconds>(known->second);
    return static_cast<std::uint32_t>((left - std::clamp(way, std::min(left / 4, least), left * 3 / 4)).count());
}

void outbound_requests::on_closed(const bridge_link& which) {
    for (const auto each : find_if([&which](const request& r) { return !r.is_cancelled && r.from == which; })) {
        cancel(each);
    }
    feeds_.close(which);
}

// A bridge that has not acknowledged it yet is told when it does.
void outbound_requests::cancel(requests::iterator which) {
    if (auto& r = which->second; r.taker.empty()) {
        r.is_cancelled = true;
        forget_id(which);
    } else {
        cancel_at_taker(which);
        take(which);
    }
}

void outbound_requests::cancel_at_taker(requests::const_iterator which) {
    const auto& [number, r] = *which;
    nats_.send_cancel({r.from.pool, r.taker}, number);
}

// -- from other pools ----------------------------------------------------------------------------------------------

void outbound_requests::on_reply(const received_message& m) {
    auto reply = m.text;
    const auto taker = take_taker(reply);
    if (is_secured_ && !taker.empty() && taker != m.by.instance) {
        nats_.drop(m, "it acknowledges a request for another bridge");
        return;
    }
    on_taken(m.about.number, taker, m.at);
    const auto found = sent_.find(m.about.number);
    if (reply.empty() || found == sent_.end()) {
        return;
    }
    if (reply.starts_with("progress=")) {
        answer(found->second, reply);
    } else {
        answer(take(found), reply);
    }
}

void outbound_requests::on_unusable_reply(const received_message& m, const protocol::failure& why) {
    auto reply = m.text;
    on_taken(m.about.number, take_taker(reply), m.at);
    if (const auto found = sent_.find(m.about.number); found != sent_.end()) {
        if (!found->second.taker.empty()) { // it may continue there, or be bound
            cancel_at_taker(found);
        }
        fail(found, why);
    }
}

void outbound_requests::on_taken(std::uint64_t number, std::string_view taker, time_point now) {
    const auto found = sent_.find(number);
    if (taker.empty() || found == sent_.end() || !found->second.taker.empty()) {
        return;
    }
    auto& r = found->second;
    r.taker = taker;
    note_round_trip(r.from.pool, std::min<time_point::duration>(now - r.sent_at, acknowledged_within));
    if (r.is_cancelled) {
        cancel(found);
    }
}

// Follows a longer one at once, and a shorter one slowly.
void outbound_requests::note_round_trip(const std::string& pool, time_point::duration took) {
    auto& known = round_trips_[pool];
    known = std::max(took, known - (known - took) / 8);
}

void outbound_requests::answer(const request& answered, std::string_view reply) {
    if (!answered.is_cancelled) {
        out_.deliver(answered.from, reply_line(answered.id, reply));
        feeds_.on_answer(answered.id, answered.number, protocol::is_failure(reply), answered.taker);
    }
}

void outbound_requests::fail(requests::iterator which, const protocol::failure& why) {
    answer(take(which), protocol::failure_text(why));
}

// It remains, so that a bridge that acknowledges it later is told.
void outbound_requests::fail_unacknowledged(requests::iterator which, std::string why) {
    answer(which->second, protocol::failure_text({.code = errc::unavailable, .message = std::move(why)}));
    cancel(which);
}

outbound_requests::request outbound_requests::take(requests::iterator which) {
    forget_id(which);
    auto taken = std::move(which->second);
    sent_.erase(which);
    return taken;
}

void outbound_requests::forget_id(requests::const_iterator of) {
    if (const auto found = numbers_.find(of->second.id); found != numbers_.end() && found->second == of->first) {
        numbers_.erase(found);
    }
}

template <class Condition>
std::vector<outbound_requests::requests::iterator> outbound_requests::find_if(Condition concerns) {
    std::vector<requests::iterator> found;
    for (auto at = sent_.begin(); at != sent_.end(); ++at) {
        if (concerns(at->second)) {
            found.push_back(at);
        }
    }
    return found;
}

void outbound_requests::on_lost(const bridge_id& gone, std::string_view why) {
    const auto lost = find_if([&gone](const request& r) {
        const auto& at = r.taker.empty() ? r.addressee : r.taker;
        return at == gone.instance && r.from.pool == gone.pool && !(r.taker.empty() && r.is_cancelled);
    });
    for (const auto each : lost) {
        if (each->second.taker.empty()) { // it may have passed on a BIND
            fail_unacknowledged(each, std::string{why});
        } else {
            fail(each, {.code = errc::unavailable, .message = std::string{why}});
        }
    }
    feeds_.on_lost(gone, why);
}

void outbound_requests::on_time(time_point now) {
    for (const auto each : find_if([now](const request& r) { return r.forgotten_at <= now; })) {
        if (const auto& r = each->second; !r.is_cancelled) { // the node has given up by itself
            if (!r.taker.empty()) {
                cancel_at_taker(each);
            }
            feeds_.cancel(r.id);
        }
        take(each);
    }
    const auto late = find_if([now](const request& r) {
        return r.taker.empty() && !r.is_cancelled && r.sent_at + acknowledged_within <= now;
    });
    for (const auto each : late) {
        fail_unacknowledged(each, "no bridge of the pool '" + each->second.from.pool + "' acknowledged the request");
    }
}

void outbound_requests::lose_pool(std::string_view pool) {
    for (const auto each : find_if([pool](const request& r) { return !r.is_cancelled && r.from.pool == pool; })) {
        cancel(each);
    }
    if (const auto known = round_trips_.find(pool); known != round_trips_.end()) {
        round_trips_.erase(known);
    }
    feeds_.lose_pool(pool);
}

void outbound_requests::clear() {
    sent_.clear();
    numbers_.clear();
    round_trips_.clear();
    feeds_.clear();
}

} // namespace cles::bridging
