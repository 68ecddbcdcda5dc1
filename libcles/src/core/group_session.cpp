// SPDX-License-Identifier: BSL-1.0
#include "core/group_session.hpp"

#include <cles/json_reader.hpp>

#include "core/bind_requests.hpp"
#include "core/request_checks.hpp"

#include <string>

namespace cles::core {

namespace {

identity identity_of(const group_source& from) {
    return {.transport = "multicast",
            .address = "udp://" + host_text(from) + ":" + std::to_string(from.port),
            .name = {},
            .uid = {},
            .local = from.is_loopback()};
}

} // namespace

void group_session::on_message(const group_source& from, const protocol::request_line* said, time_point now) {
    if (from == self_) { // looped back for others on this host
        return;
    }
    ++node_.counts.group_received;
    if (said == nullptr || !serve(from, *said, now)) {
        ++node_.counts.group_dropped;
    }
}

bool group_session::serve(const group_source& from, const protocol::request_line& request, time_point now) {
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
    if (!solicits) {
        return !sources_.is_foreign(from, now) && bind_noun(from, bind, now);
    }
    if (!allows(node_, identity_of(from), bind)) {
        return false;
    }
    if (presence_ != nullptr) {
        presence_->on_solicitation(by_name, now);
    }
    return true;
}

// By the access rules, and by the handler for BIND where there is one.
bool group_session::bind_noun(const group_source& from, const protocol::request_line& bind, time_point now) {
    const auto peer = identity_of(from);
    if (!allows(node_, peer, bind)) {
        return false;
    }
    if (bind.unbinds()) {
        welcomes_.drop(from, bind);
    } else if (bind_decision::is_needed(node_, bind)) {
        return welcomes_.ask(from, peer, bind, now);
    } else {
        try {
            ask_bind_handler(node_, peer, bind);
        } catch (...) { // there is nobody to tell
            return false;
        }
    }
    return bindings_.bind(from, bind, now);
}

bool group_session::is_from_publisher(const group_source& from, const protocol::request_line& update, time_point now) {
    using verdict = publisher_sources::verdict;
    const auto node = update.noun.target;
    const auto found = sources_.is_foreign(from, now) ? verdict::refused : sources_.look(node, from, now);
    if (found == verdict::another) {
        feeds_.forget(node);
    }
    return found != verdict::refused;
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
    if (protocol::begins_with_error(update.body) || !feeds_.wants(update) || !is_from_publisher(from, update, now) ||
        !feeds_.take(update)) {
        ++node_.counts.updates_dropped;
    } else {
        ++node_.counts.updates_received;
    }
    return true;
}

} // namespace cles::core
