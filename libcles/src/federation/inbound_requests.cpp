// SPDX-License-Identifier: BSL-1.0
#include "federation/inbound_requests.hpp"

#include "federation/carried_line.hpp"

#include <array>
#include <cstddef>

namespace cles::bridging {
namespace {

constexpr std::array all_verbs{verb::pull, verb::push, verb::delegate, verb::bind, verb::update};
constexpr std::chrono::seconds remembered_for{10}; // after a bridge is lost, or before it is known
constexpr std::size_t max_not_live = 1024;

} // namespace

// In a secured fleet, requests are sent to the subject of one bridge.
void inbound_requests::on_connected() {
    if (trust_ == nullptr && !leaving_) {
        for (const auto how : all_verbs) {
            out_.subscribe(request_filter(nats_.pool(), how), true);
        }
    }
}

void inbound_requests::leave() {
    leaving_ = true;
    if (trust_ == nullptr && nats_.is_open()) {
        for (const auto how : all_verbs) {
            out_.unsubscribe(request_filter(nats_.pool(), how));
        }
    }
}

// -- from other pools ----------------------------------------------------------------------------------------------

void inbound_requests::take(const received_message& m, std::string_view line, bool is_passed_on) {
    protocol::request_line r;
    protocol::malformed_request wrong;
    if (protocol::parse_request(line, r, wrong) && r.is_update()) {
        wrong.why = "an update with 'seq' and 'epoch' is not a request";
    }
    if (!wrong.why.empty()) {
        nats_.drop(m, wrong.why);
        nats_.refuse(m.reply, {.code = errc::bad_request, .message = wrong.why});
        return;
    }
    if (r.noun.target == "self" || (r.noun.task == "cles" && r.verb != verb::pull)) {
        nats_.refuse(m.reply, {.code = errc::no_target,
                               .message = "requests to the task 'cles' that concern a link do not cross NATS"});
        return;
    }
    const bool is_bridge = m.from.kind == subject_kind::reply;
    request asked{.by = is_bridge ? m.from.bridge() : bridge_id{},
                  .number = m.from.number,
                  .reply = std::string{m.reply},
                  .member = std::string{m.by.member}};
    if (trust_ != nullptr && !is_bridge) { // nobody would notice its loss, or that it arrives again
        nats_.drop(m, "only bridges send sealed requests");
        return;
    }
    if (const auto why = why_not_served(asked, is_passed_on)) {
        nats_.refuse(m.reply, *why);
        return;
    }
    if (asked.by.pool != nats_.pool() && has_passed(r.via, nats_.pool())) {
        nats_.refuse(m.reply, {.code = errc::no_target,
                               .message = "the request has passed through the pool '" + nats_.pool() +
                                          "' before: the pools in 'via' form a loop"});
        return;
    }
    if (r.verb == verb::bind) {
        bind(r, asked, is_passed_on);
        return;
    }
    if (is_bridge && !remember(asked.by, m.at)) {
        nats_.refuse(m.reply, {.code = errc::busy,
                               .message = "too many bridges that are not known here ask",
                               .retry_ms = protocol::default_retry_ms});
        return;
    }
    if (is_bridge && !seen_[asked.by].add(asked.number)) {
        ++nats_.counts().messages_refused; // it has arrived before
        return;
    }
    ++nats_.counts().requests_taken;
    const auto id = ++last_id_;
    const auto on = asked.on();
    if (r.wants_reply) {
        if (is_bridge) {
            ids_.emplace(std::pair{asked.by, asked.number}, id);
            unacknowledged_.push_back(id);
        }
        taken_.emplace(id, std::move(asked));
    }
    out_.deliver(on, line_of(r, id, on.pool));
}

protocol::failure inbound_requests::not_known_yet() const {
    return {.code = errc::busy,
            .message = "the bridge '" + node_ + "' does not know the one that asks yet",
            .retry_ms = protocol::default_retry_ms};
}

void inbound_requests::refuse_unproven(const received_message& m) {
    if (nats_.is_open() && m.about.kind == subject_kind::request && m.about.bridge() == nats_.self()) {
        nats_.refuse(m.reply, not_known_yet());
    }
}

// Why a request of that bridge of a secured fleet is refused. What a bridge asks that is not known, or lost, may have
// been held back for long.
std::optional<protocol::failure> inbound_requests::why_not_served(const request& by, bool is_passed_on) const {
    if (trust_ == nullptr) {
        return {};
    }
    if (leaving_) {
        return protocol::failure{
            .code = errc::busy, .message = node_ + " is shutting down", .retry_ms = protocol::default_retry_ms};
    }
    if (pools_.is_live(by.by)) {
        return {};
    }
    if (!is_passed_on && !trust_->may_forward(by.member)) {
        return protocol::failure{.code = errc::denied,
                                 .message = "'" + by.member + "' may not forward for '" + node_ + "' " +
                                            trust_->how_to_permit(by.member)};
    }
    return not_known_yet();
}

// Whether its requests can be recognised if they arrive again. It may not be known yet.
bool inbound_requests::remember(const bridge_id& by, time_point now) {
    if (pools_.is_live(by)) {
        return true;
    }
    if (not_live_.size() >= max_not_live && !not_live_.contains(by)) {
        return false;
    }
    not_live_.insert_or_assign(by, now + remembered_for);
    return true;
}

void inbound_requests::bind(const protocol::request_line& r, const request& by, bool is_passed_on) {
    if (by.by.pool.empty()) {
        nats_.refuse(by.reply, {.code = errc::bad_request, .message = "only bridges bind through NATS"});
        return;
    }
    if (!pools_.is_live(by.by)) { // nobody would notice its loss
        nats_.refuse(by.reply, {.code = errc::busy,
                                .message = "the bridge that binds is not known here yet",
                                .retry_ms = static_cast<std::uint64_t>(retry_.count())});
        return;
    }
    if (const auto why = trust_ != nullptr ? trust_->refusal(by.member, r) : std::nullopt) {
        nats_.refuse(by.reply, *why);
        return;
    }
    const auto publisher = pools_.publisher_of(nats_.pool(), noun_of(r));
    if (is_passed_on || publisher == nats_.self().instance || publisher.empty()) {
        published_.bind(r, {by.by, by.reply, requester_of(r, by)});
        return;
    }
    auto message = message_of(r, {});
    if (trust_ != nullptr && r.from.empty()) { // that one knows this bridge only
        message.insert(r.noun.path.size() - r.noun.task.size(), " from=" + by.member);
    }
    nats_.publish_short(control_subject({nats_.pool(), std::string{publisher}}),
                        text_of(verb::bind, r.noun.target, r.noun.task, message), by.reply);
}

// In a secured fleet, the bridge that asks, or the member for which it does.
std::string inbound_requests::requester_of(const protocol::request_line& r, const request& by) const {
    if (trust_ == nullptr) {
        return {};
    }
    return r.from.empty() ? by.member : std::string{r.from};
}

bool inbound_requests::cancel(const bridge_id& by, std::uint64_t number) {
    const auto id = ids_.find({by, number});
    if (id == ids_.end()) {
        return false;
    }
    cancel(*taken_.find(id->second));
    return true;
}

void inbound_requests::cancel(const requests::value_type& which) {
    out_.deliver(which.second.on(), cancel_line(which.first) + " reply=no");
}

inbound_requests::requests::node_type inbound_requests::remove(requests::const_iterator which) {
    ids_.erase({which->second.by, which->second.number});
    return taken_.extract(which);
}

template <class Condition>
inbound_requests::requests inbound_requests::take_if(Condition concerns) {
    requests found;
    for (auto next = taken_.begin(); next != taken_.end();) {
        const auto here = next++;
        if (concerns(here->second)) {
            found.insert(remove(here));
        }
    }
    return found;
}

void inbound_requests::on_lost(const bridge_id& gone, time_point now) {
    for (const auto& each : take_if([&gone](const request& r) { return r.by == gone; })) {
        cancel(each);
    }
    not_live_.insert_or_assign(gone, now + remembered_for); // copies of its requests may still arrive
}

void inbound_requests::on_time(time_point now) {
    std::erase_if(not_live_, [&](const auto& each) {
        const bool is_over = each.second <= now;
        if (is_over && !pools_.is_live(each.first)) {
            seen_.erase(each.first);
        }
        return is_over;
    });
}

void inbound_requests::clear() {
    taken_.clear();
    ids_.clear();
    unacknowledged_.clear();
    seen_.clear();
    not_live_.clear();
}

// -- from the node -------------------------------------------------------------------------------------------------

void inbound_requests::on_batch() {
    for (const auto id : std::exchange(unacknowledged_, {})) {
        if (const auto open = taken_.find(id); open != taken_.end()) {
            nats_.acknowledge(open->second.reply);
        }
    }
}

void inbound_requests::on_line(std::string_view line) {
    const auto parts = split_reply(line);
    const auto found = taken_.find(parts.id);
    if (found == taken_.end()) {
        return; // nobody waits
    }
    if (!found->second.reply.empty()) {
        reply(found->second.reply, parts.rest, parts.is_interim);
    }
    if (!parts.is_interim) {
        remove(found);
    }
}

void inbound_requests::reply(const std::string& to, std::string_view rest, bool is_interim) {
    const bool fits = nats_.fits(rest);
    if ((fits && nats_.answer(to, rest)) || is_interim) {
        return;
    }
    if (fits) {
        nats_.refuse(to, {.code = errc::busy,
                          .message = "too much waits to be sent to NATS for the reply",
                          .retry_ms = protocol::default_retry_ms,
                          .ran = true});
    } else {
        nats_.refuse(to, {.code = errc::too_large,
                          .message = "the reply has " + std::to_string(rest.size()) + " bytes; NATS permits " +
                                     std::to_string(nats_.max_message()) + " here",
                          .ran = true});
    }
}

void inbound_requests::on_closed(const bridge_link& which) {
    for (const auto& [id, r] : take_if([&which](const request& r) { return r.on() == which; })) {
        nats_.refuse(r.reply, {.code = errc::unavailable, .message = node_ + " has closed the link"});
    }
}

} // namespace cles::bridging
