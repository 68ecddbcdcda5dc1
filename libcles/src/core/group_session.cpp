// SPDX-License-Identifier: BSL-1.0
#include "core/group_session.hpp"

#include <cles/json_reader.hpp>

#include "core/bind_requests.hpp"
#include "core/request_checks.hpp"
#include "protocol/datagram.hpp"
#include "protocol/line.hpp"

#include <string>

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

bool group_session::on_bind(const group_source& from, const protocol::request_line& bind, time_point now) {
    const auto& noun = bind.noun;
    const bool solicits = noun.task == "cles";
    if (solicits && !noun.parameters.empty()) {
        return false;
    }
    const bool by_name = noun.target != "all";
    if (by_name && noun.target != node_.name) { // another's
        return true;
    }
    if (!permits(from, bind)) {
        return false;
    }
    if (!solicits) {
        return bindings_.bind(from, bind, now);
    }
    if (presence_ != nullptr) {
        presence_->on_solicitation(by_name, now);
    }
    return true;
}

// The access rules, and the handler for BIND where there is one.
bool group_session::permits(const group_source& from, const protocol::request_line& bind) const {
    const identity peer{.transport = "multicast",
                        .address = "udp://" + host_text(from) + ":" + std::to_string(from.port),
                        .name = {},
                        .uid = {},
                        .local = from.is_loopback()};
    if (!allows(node_, peer, bind)) {
        return false;
    }
    if (bind.unbinds()) {
        return true;
    }
    try {
        ask_bind_handler(node_, peer, bind);
        return true;
    } catch (...) { // there is nobody to tell
        return false;
    }
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
    if (protocol::begins_with_error(update.body) || !feeds_.take(update)) {
        ++node_.counts.updates_dropped;
    } else {
        ++node_.counts.updates_received;
    }
    return true;
}

} // namespace cles::core
