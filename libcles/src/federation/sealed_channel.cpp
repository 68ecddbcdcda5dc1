// SPDX-License-Identifier: BSL-1.0
#include "federation/sealed_channel.hpp"

#include "protocol/hex_number.hpp"

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

core::message_seal::origin origin_of(const bridge_id& sender, const std::string& questions, bool is_update) {
    return {.instance = protocol::parse_hex<std::uint64_t>(sender.instance),
            .questions = questions,
            .is_update = is_update};
}

} // namespace

sealed_channel::sealed_channel(std::unique_ptr<core::message_seal> seal, std::string pool)
    : seal_(std::move(seal)), questions_(question_subject({std::move(pool), instance_text(seal_->instance())})) {}

void sealed_channel::receive(received_message m, bridge& to) {
    const auto sender = sender_of(m);
    const auto questions = sender.pool.empty() ? std::string{} : question_subject(sender);
    const auto from = origin_of(sender, questions, m.about.kind == subject_kind::feed);
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
    seal_->on_stated_roster(origin_of(by, questions, false), version, now);
}

void sealed_channel::forget(const bridge_id& lost) {
    if (const auto instance = protocol::parse_hex<std::uint64_t>(lost.instance)) {
        seal_->forget(*instance);
    }
}

} // namespace cles::bridging
