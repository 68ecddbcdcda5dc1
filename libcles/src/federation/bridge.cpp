// SPDX-License-Identifier: BSL-1.0
#include "federation/bridge.hpp"

#include "federation/carried_line.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <utility>

namespace cles::bridging {
namespace {

constexpr std::chrono::milliseconds drain_limit{500}; // if the server does not answer

} // namespace

bridge::bridge(const settings& setup, bridge_output& out, bridge_trust* trust)
    : max_line_(setup.max_line), out_(out), trust_(trust), nats_(setup.pool, out),
      presence_(nats_, out, trust, setup.node, setup.interval,
                [this](const bridge_id& gone, std::string_view why, time_point now) { on_lost(gone, why, now); }),
      outbound_(nats_, out, presence_.pools(), trust != nullptr), published_(nats_, out),
      inbound_(nats_, out, presence_.pools(), trust, published_, setup.node, setup.interval) {}

// -- the connection ------------------------------------------------------------------------------------------------

void bridge::on_connected(std::uint64_t drawn, std::size_t max_message, time_point now) {
    constexpr std::size_t around = 256; // the part of a line that is not in the message
    auto before = self().instance;
    nats_.open(instance_text(drawn), std::min(max_message, max_line_ - std::min(around, max_line_)));
    inbound_.on_connected();
    presence_.on_connected(std::move(before), now);
}

void bridge::on_disconnected(std::string_view why, time_point now) {
    if (!is_connected()) {
        return;
    }
    nats_.close();
    outbound_.clear();
    inbound_.clear();
    published_.clear();
    presence_.on_disconnected(now);
    out_.lose_all("the connection to NATS was lost: " + std::string{why});
    out_.on_pools_changed();
}

void bridge::leave(time_point now) {
    if (!std::exchange(leaving_, true)) {
        inbound_.leave();
        presence_.leave(now);
        if (is_connected()) { // the server sends it after all that it has sent before
            drained_by_ = now + drain_limit;
            nats_.send_control(self(), std::string{drained_line});
        }
    }
}

void bridge::on_time(time_point now) {
    if (drained_by_ && *drained_by_ <= now) {
        drained_by_.reset();
    }
    if (is_connected()) {
        presence_.on_time(now);
        inbound_.on_time(now);
        outbound_.on_time(now);
    }
}

void bridge::on_lost(const bridge_id& gone, std::string_view why, time_point now) {
    inbound_.on_lost(gone, now);
    published_.on_lost(gone);
    if (pools().is_live(gone.pool)) {
        outbound_.on_lost(gone, why);
    } else {
        outbound_.lose_pool(gone.pool);
        out_.lose_pool(gone.pool, why);
    }
}

// -- messages ------------------------------------------------------------------------------------------------------

void bridge::on_message(const received_message& m) {
    auto kind = m.about.kind;
    if (!is_connected() || (trust_ != nullptr && kind != subject_kind::heartbeat && !has_effect(m))) {
        return;
    }
    const bool is_for_this_bridge = !m.about.instance.empty();
    if (trust_ == nullptr && kind == subject_kind::request && is_for_this_bridge) {
        kind = subject_kind::foreign; // permissions of NATS are about subjects that state verb, node and task
    }
    const bool is_too_long = !nats_.fits(m.text); // its line could not be read
    if (is_too_long || protocol::has_many_lines(m.text)) {
        refuse_unreadable(m, kind, is_too_long);
        return;
    }
    switch (kind) {
    case subject_kind::request:
        if (is_for_this_bridge) {
            inbound_.take(m, m.text, false);
        } else {
            inbound_.take(m, text_of(m.about.verb, m.about.node, m.about.task, m.text), false);
        }
        break;
    case subject_kind::feed: outbound_.on_update(m); break;
    case subject_kind::heartbeat: presence_.on_heartbeat(m); break;
    case subject_kind::names: presence_.on_names(m); break;
    case subject_kind::control: on_control(m); break;
    case subject_kind::reply: outbound_.on_reply(m); break;
    case subject_kind::question: // of seals; without security, nobody asks
    case subject_kind::foreign: nats_.drop(m, "it is not a subject of CLES"); break;
    }
}

// A line break would end a line of the node's links.
void bridge::refuse_unreadable(const received_message& m, subject_kind kind, bool is_too_long) {
    using protocol::failure;
    const std::string why = is_too_long ? "it is too long" : "a message of NATS holds one line";
    const auto most = std::to_string(nats_.max_message());
    nats_.drop(m, why);
    if (kind == subject_kind::request) {
        nats_.refuse(m.reply, is_too_long ? failure{.code = errc::too_large,
                                                    .message = "a request has at most " + most + " bytes here"}
                                          : failure{.code = errc::bad_request, .message = why});
    } else if (kind == subject_kind::reply) {
        outbound_.on_unusable_reply(
            m, is_too_long
                   ? failure{.code = errc::too_large,
                             .message = "the reply has " + std::to_string(m.text.size()) + " bytes; at most " + most +
                                        " are read here",
                             .ran = true}
                   : failure{.code = errc::failed, .message = "the reply that came through NATS is not one line"});
    }
}

// Whether a message that was opened has an effect. A server could deliver a request to a second bridge, where it would
// run again. Requests and control lines are answered if their sender is not known.
bool bridge::has_effect(const received_message& m) {
    const auto kind = m.about.kind;
    const bool is_for_all = kind == subject_kind::feed || kind == subject_kind::names;
    if (!is_for_all && m.about.bridge() != self()) {
        nats_.drop(m, "it is not for this bridge");
        return false;
    }
    if (kind == subject_kind::request || kind == subject_kind::control || m.by.instance == self().instance) {
        return true;
    }
    if (!presence_.admit(m.by)) {
        return false;
    }
    if (kind == subject_kind::feed && !pools().is_live({m.about.pool, std::string{m.by.instance}})) {
        nats_.drop(m, "its sender is no bridge that is known here");
        return false;
    }
    return true;
}

void bridge::on_control(const received_message& m) {
    const auto stated = m.from.bridge(); // with security, it has to be the sender
    const auto kind = m.from.kind;
    protocol::request_line r;
    protocol::malformed_request wrong;
    if ((kind != subject_kind::control && kind != subject_kind::reply) || !protocol::parse_request(m.text, r, wrong)) {
        nats_.drop(m, "it is not a message of a bridge");
        return;
    }
    // A bridge of the own pool passes on the BIND of another one.
    const bool is_passed_on = r.verb == verb::bind && !r.unbinds();
    if (trust_ != nullptr && stated.instance != m.by.instance &&
        !(is_passed_on && pools().is_live(bridge_id{self().pool, std::string{m.by.instance}}))) {
        nats_.drop(m, "it is for another bridge than its sender");
        return;
    }
    if (is_passed_on) {
        inbound_.take(m, m.text, true);
    } else if (r.unbinds()) {
        published_.unbind(noun_of(r), stated);
    } else if (m.text == names_line) {
        presence_.on_asked_for_names(m.at);
    } else if (m.text == drained_line) {
        if (stated == self()) {
            drained_by_.reset();
        }
    } else if (m.text == lost_line) {
        presence_.on_forgotten_by(stated, m.at);
    } else if (const auto number = cancelled_number(r)) {
        if (!inbound_.cancel(stated, *number)) {
            published_.cancel(stated, m.reply);
        }
    } else if (const auto bound = unbound_number(r)) {
        outbound_.on_unbound(stated, *bound);
    } else {
        nats_.drop(m, "it is not a message of a bridge");
    }
}

// -- lines of the node ---------------------------------------------------------------------------------------------

void bridge::on_line(const bridge_link& from, std::string_view line, time_point now) {
    if (!is_connected()) {
        return; // the link is being lost
    }
    switch (from.what) {
    case bridge_link::role::to_pool: outbound_.on_line(from, line, now); break;
    case bridge_link::role::from_pool: inbound_.on_line(line); break;
    case bridge_link::role::publications: published_.on_line(from, line); break;
    }
}

void bridge::on_closed(const bridge_link& which) {
    switch (which.what) {
    case bridge_link::role::to_pool: outbound_.on_closed(which); break;
    case bridge_link::role::from_pool: inbound_.on_closed(which); break;
    case bridge_link::role::publications:
        if (leaving_ && which.member.empty()) {
            published_.clear(); // the last heartbeat says it, when what the server has for this bridge is answered
        } else {
            published_.on_closed(which);
        }
        break;
    }
}

} // namespace cles::bridging
