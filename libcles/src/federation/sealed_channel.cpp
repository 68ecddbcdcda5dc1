// SPDX-License-Identifier: BSL-1.0
#include "federation/sealed_channel.hpp"

#include "protocol/hex_number.hpp"

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

namespace cles::bridging {
namespace {

// The bridge that has sent it, where the subjects state it: its own subject, or the one where it waits for replies. A
// control line for a request may be of a bridge that passes the request on.
bridge_id sender_of(const received_message& m) {
    const auto kind = m.about.kind;
    if (kind == subject_kind::heartbeat || kind == subject_kind::names) {
        return m.about.bridge();
    }
    const auto from = m.from.kind;
    const bool is_sender = from == subject_kind::control || from == subject_kind::question ||
                           (from == subject_kind::reply && kind == subject_kind::request);
    return is_sender ? m.from.bridge() : bridge_id{};
}

// Requests, replies and control lines. All other messages are for all bridges, or questions.
bool is_for_one(const subject& about) noexcept {
    return about.kind == subject_kind::request || about.kind == subject_kind::reply ||
           about.kind == subject_kind::control;
}

core::message_seal::origin origin_of(const bridge_id& sender, const std::string& questions) {
    return {.instance = protocol::parse_hex<std::uint64_t>(sender.instance), .questions = questions};
}

std::size_t bytes_of(const sealed_channel::outgoing& what) {
    return sizeof what + what.subject.size() + what.reply.size() + what.message.size();
}

} // namespace

sealed_channel::sealed_channel(std::unique_ptr<core::message_seal> seal, std::string pool)
    : seal_(std::move(seal)), questions_(question_subject({std::move(pool), instance_text(seal_->instance())})) {}

core::message_seal::sealed_message sealed_channel::seal(std::string_view subject, std::string_view reply,
                                                        std::string_view message, time_point now) {
    const auto about = parse_subject(subject);
    const auto to = is_for_one(about) ? protocol::parse_hex<std::uint64_t>(about.instance) : std::nullopt;
    if (!to) {
        return {.bytes = seal_->seal(subject, reply, message)};
    }
    auto sealed = seal_->seal_for(*to, subject, reply, message, now);
    if (sealed.waits) {
        sealed.waits = keep_waiting(
            *to, {.subject = std::string{subject}, .reply = std::string{reply}, .message = std::string{message}}, now);
    }
    return sealed;
}

void sealed_channel::receive(received_message m, bridge& to) {
    const bool is_for_a_bridge = is_for_one(m.about);
    if (is_for_a_bridge && m.about.bridge() != to.self()) {
        to.on_refused(m, "it is not for this bridge");
        return;
    }
    const auto sender = sender_of(m);
    const auto questions = sender.pool.empty() ? std::string{} : question_subject(sender);
    auto from = origin_of(sender, questions);
    from.is_update = m.about.kind == subject_kind::feed;
    from.is_for_one = is_for_a_bridge;
    if (m.about.kind == subject_kind::question) {
        if (m.where != questions_) {
            to.on_refused(m, "it is not for this bridge");
        } else if (seal_->on_question(m.where, from, m.text, m.at)) {
            to.announce_soon(m.at);
        }
        return;
    }
    const auto opened = seal_->open(m.where, m.reply, from, m.text, m.at);
    const auto instance = instance_text(opened.instance);
    switch (opened.what) {
    case core::message_seal::verdict::opened:
        m.by = {opened.sender, instance};
        m.text = opened.message;
        to.on_message(m);
        break;
    case core::message_seal::verdict::unproven: to.on_unproven(m); break;
    case core::message_seal::verdict::refused: to.on_refused(m, opened.why); break;
    }
}

void sealed_channel::on_stated_roster(const bridge_id& by, std::uint32_t version, time_point now) {
    const auto questions = question_subject(by);
    seal_->on_stated_roster(origin_of(by, questions), version, now);
}

void sealed_channel::on_stated_sessions(const bridge_id& by, time_point now) {
    const auto questions = question_subject(by);
    seal_->on_stated_sessions(origin_of(by, questions), now);
}

void sealed_channel::forget(const bridge_id& lost) {
    if (const auto instance = protocol::parse_hex<std::uint64_t>(lost.instance)) {
        seal_->forget(*instance);
        if (const auto found = waiting_.find(*instance); found != waiting_.end()) {
            waiting_bytes_ -= found->second.bytes;
            waiting_.erase(found);
        }
    }
}

// -- what waits for a session --------------------------------------------------------------------------------------

bool sealed_channel::keep_waiting(std::uint64_t to, outgoing what, time_point now) {
    const auto size = bytes_of(what);
    auto& of = waiting_[to];
    drop_late(of, now);
    if (of.bytes + size > most_waiting_for_one || waiting_bytes_ + size > most_waiting) {
        return false;
    }
    of.bytes += size;
    waiting_bytes_ += size;
    of.queue.push_back({.what = std::move(what), .until = now + longest_wait});
    return true;
}

void sealed_channel::drop_first(waiting_messages& of) {
    const auto size = bytes_of(of.queue.front().what);
    of.bytes -= size;
    waiting_bytes_ -= size;
    of.queue.pop_front();
}

// Nobody may be waiting for what it says any more.
void sealed_channel::drop_late(waiting_messages& of, time_point now) {
    while (!of.queue.empty() && of.queue.front().until <= now) {
        drop_first(of);
    }
}

bool sealed_channel::has_waiting(time_point now) {
    return std::ranges::any_of(waiting_, [&](auto& each) {
        drop_late(each.second, now);
        return !each.second.queue.empty();
    });
}

std::vector<sealed_channel::outgoing> sealed_channel::take_ready(time_point now) {
    std::vector<outgoing> ready;
    for (auto next = waiting_.begin(); next != waiting_.end();) {
        auto& [to, of] = *next;
        drop_late(of, now);
        while (!of.queue.empty()) {
            const auto& first = of.queue.front().what;
            auto sealed = seal_->seal_for(to, first.subject, first.reply, first.message, now);
            if (sealed.waits) {
                break;
            }
            if (sealed.in_session) { // what was to be sealed under a session is never sent in another way
                ready.push_back({.subject = first.subject, .reply = first.reply, .message = std::move(sealed.bytes)});
            }
            drop_first(of);
        }
        next = of.queue.empty() ? waiting_.erase(next) : std::next(next);
    }
    return ready;
}

} // namespace cles::bridging
