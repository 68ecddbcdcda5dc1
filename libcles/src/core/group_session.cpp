// SPDX-License-Identifier: BSL-1.0
#include "core/group_session.hpp"

#include <cles/json_reader.hpp>

#include "protocol/datagram.hpp"
#include "protocol/line.hpp"

namespace cles::core {

void group_session::on_datagram(const group_source& from, std::string_view datagram, time_point now) {
    if (from == self_) { // looped back for others on this host
        return;
    }
    ++node_.counts.group_received;
    if (!serve(from, datagram, now)) {
        ++node_.counts.group_dropped;
    }
}

bool group_session::serve(const group_source& from, std::string_view datagram, time_point now) {
    if (datagram.size() > protocol::datagram_bytes) {
        return false;
    }
    if (datagram.ends_with('\n')) {
        datagram.remove_suffix(1);
    }
    const auto line = protocol::trim(datagram);
    if (line.empty() || protocol::has_many_lines(line) || protocol::is_reply(line)) {
        return false;
    }
    protocol::request_line request;
    protocol::malformed_request ignored;
    if (!protocol::parse_request(line, request, ignored)) {
        return false;
    }
    const auto target = request.noun.target;
    if (request.is_update()) {
        return !protocol::is_reserved_target(target) && on_update(from, request, now);
    }
    return request.verb == verb::bind && (target == "all" || !protocol::is_reserved_target(target)) &&
           on_bind(from, request, now);
}

bool group_session::on_bind(const group_source&, const protocol::request_line& bind, time_point now) {
    const auto& noun = bind.noun;
    if (noun.task == "cles") {
        if (!noun.parameters.empty()) {
            return false;
        }
        const bool by_name = noun.target != "all";
        if (presence_ != nullptr && (!by_name || noun.target == node_.name)) {
            presence_->on_solicitation(by_name, now);
        }
        return true;
    }
    return true;
}

bool group_session::on_update(const group_source& from, const protocol::request_line& update, time_point now) {
    const auto& noun = update.noun;
    if (noun.task == "cles") {
        if (!noun.parameters.empty() || !is_valid_json(update.body, node_.bounds.depth)) {
            return false;
        }
        if (presence_ != nullptr) {
            presence_->on_announcement(from, update, now);
        }
        return true;
    }
    return true;
}

} // namespace cles::core
