// SPDX-License-Identifier: BSL-1.0
#include "core/group_session.hpp"

#include "core/bind_requests.hpp"
#include "core/request_checks.hpp"

namespace cles::core {

namespace {

identity identity_of(const group_source& from) {
    return {.transport = "multicast",
            .address = "udp://" + to_text(from),
            .name = {},
            .uid = {},
            .local = from.is_loopback()};
}

} // namespace

void group_session::on_message(const group_source& from, const protocol::request_line* said, time_point now) {
    if (intake_.is_own(from)) {
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
        return !protocol::is_reserved_target(target) && intake_.take(from, request, now);
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
        return !intake_.is_passed_over(from, now) && bind_noun(from, bind, now);
    }
    if (!allows(node_, identity_of(from), bind)) {
        return false;
    }
    intake_.solicited(by_name, now);
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

} // namespace cles::core
