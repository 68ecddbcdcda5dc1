// SPDX-License-Identifier: BSL-1.0
#include "federation/sealed_channel.hpp"

#include "protocol/hex_number.hpp"

#include <utility>

namespace cles::bridging {
namespace {

// The bridge that has sent it, where the subjects state it: its own subject, or the one where it waits for replies. A
// control line for a request may be of a bridge that passes the request on.
bridge_id sender_of(const subject& where, std::string_view reply) {
    if (where.kind == subject_kind::heartbeat || where.kind == subject_kind::names) {
        return where.bridge();
    }
    const auto from = parse_subject(reply);
    const bool is_sender = from.kind == subject_kind::control || from.kind == subject_kind::question ||
                           (from.kind == subject_kind::reply && where.kind == subject_kind::request);
    return is_sender ? from.bridge() : bridge_id{};
}

core::message_seal::origin origin_of(const bridge_id& sender, const std::string& questions, bool is_update) {
    return {.instance = protocol::parse_hex<std::uint64_t>(sender.instance),
            .questions = questions,
            .is_update = is_update};
}

} // namespace

sealed_channel::sealed_channel(std::unique_ptr<core::message_seal> seal, std::string pool)
    : seal_(std::move(seal)), questions_(question_subject({std::move(pool), instance_text(seal_->instance())})) {}

sealed_channel::received sealed_channel::receive(std::string_view where, std::string_view reply, std::string_view bytes,
                                                 time_point now) {
    const auto about = parse_subject(where);
    const auto sender = sender_of(about, reply);
    const auto questions = sender.pool.empty() ? std::string{} : question_subject(sender);
    const auto from = origin_of(sender, questions, about.kind == subject_kind::feed);
    if (about.kind == subject_kind::question) {
        if (where != questions_) {
            return {.why = "it is not for this bridge"};
        }
        return {.what = outcome::consumed, .heartbeat_soon = seal_->on_question(where, from, bytes, now)};
    }
    const auto opened = seal_->open(where, reply, from, bytes, now);
    switch (opened.what) {
    case core::message_seal::verdict::opened:
        return {.what = outcome::opened,
                .sender = opened.sender,
                .instance = instance_text(opened.instance),
                .message = opened.message};
    case core::message_seal::verdict::unproven: return {.what = outcome::unproven};
    case core::message_seal::verdict::refused: break;
    }
    return {.why = opened.why};
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

std::vector<sealed_channel::outgoing> sealed_channel::take_questions() {
    std::vector<outgoing> all;
    for (auto& each : seal_->take_questions(questions_)) {
        all.push_back({std::move(each.subject), questions_, std::move(each.message)});
    }
    return all;
}

} // namespace cles::bridging
