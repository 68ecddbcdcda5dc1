// SPDX-License-Identifier: BSL-1.0
#include "federation/bridge_connection.hpp"

#include "federation/carried_line.hpp"

#include <string>

namespace cles::bridging {
namespace {

constexpr std::size_t max_short = 1024; // of a failure for which room is reserved

} // namespace

void bridge_connection::open(std::string instance, std::size_t max_message) {
    self_.instance = std::move(instance);
    max_message_ = max_message;
    is_open_ = true;
    ++counts_.connections;
    out_.subscribe(inbox_filter(self_), false);
    out_.subscribe(std::string{heartbeat_filter}, false);
    out_.subscribe(std::string{names_filter}, false);
}

bool bridge_connection::publish(std::string subject, std::string message, std::string reply) {
    return out_.publish(std::move(subject), std::move(reply), std::move(message), bridge_output::room::shared);
}

void bridge_connection::publish_short(std::string subject, std::string message, std::string reply) {
    out_.publish(std::move(subject), std::move(reply), std::move(message), bridge_output::room::reserved);
}

bool bridge_connection::answer(const std::string& to, std::string_view reply, std::string_view head) {
    auto message = std::string{head}.append(reply);
    if (protocol::is_failure(reply) && reply.size() <= max_short) {
        publish_short(to, std::move(message));
        return true;
    }
    return fits(message) && publish(to, std::move(message));
}

void bridge_connection::acknowledge(const std::string& to) { publish_short(to, taken_text(self_.instance)); }

void bridge_connection::refuse(std::string_view to, const protocol::failure& why) {
    if (!to.empty()) {
        publish_short(std::string{to}, protocol::failure_text(why));
    }
}

void bridge_connection::send_control(const bridge_id& to, std::string line) {
    publish_short(control_subject(to), std::move(line), control_subject(self_));
}

void bridge_connection::send_cancel(const bridge_id& to, std::uint64_t number) {
    publish_short(control_subject(to), cancel_line(number), reply_subject(self_, number));
}

void bridge_connection::drop(const received_message& m, std::string_view why) {
    ++counts_.messages_refused;
    if (const auto left_out = dropped_.take({.kind = "dropped", .source = m.by.member}, m.at)) {
        const auto sender = m.by.member.empty() ? std::string{} : " from " + std::string{m.by.member};
        out_.log(log_level::warning, "dropped a message of NATS" + sender + " on " +
                                         std::string{m.where.substr(0, 256)} + ": " + std::string{why} +
                                         core::left_out_text(*left_out));
    }
}

} // namespace cles::bridging
