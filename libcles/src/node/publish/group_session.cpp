// SPDX-License-Identifier: BSL-1.0
#include "node/publish/group_session.hpp"

#include "node/base/deadlines.hpp"
#include "node/publish/bind_requests.hpp"
#include "node/session/request_checks.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

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
    if (dispatcher_.is_own(from)) {
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
        return !protocol::is_reserved_target(target) && dispatcher_.take(from, request, now);
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
    if (by_name && noun.target != node_.name) { // for another node
        return true;
    }
    if (!solicits) {
        return !dispatcher_.is_ignored(from, now) && bind_noun(from, bind, now);
    }
    if (!allows(node_, identity_of(from), bind)) {
        return false;
    }
    dispatcher_.solicited(by_name, now);
    return true;
}

// Subject to the access rules, and to the handler for BIND if there is one.
bool group_session::bind_noun(const group_source& from, const protocol::request_line& bind, time_point now) {
    const auto peer = identity_of(from);
    if (!allows(node_, peer, bind)) {
        return false;
    }
    if (bind.unbinds()) {
        pending_bindings_.drop(from, bind);
    } else if (bind_decision::is_needed(node_, bind)) {
        return pending_bindings_.ask(from, peer, bind, now);
    } else {
        try {
            ask_bind_handler(node_, peer, bind);
        } catch (...) { // nothing is answered in the group
            return false;
        }
    }
    return bindings_.bind(from, bind, now);
}

std::list<pending_group_bindings::waiting>::iterator pending_group_bindings::find(const group_source& from,
                                                                                  std::string_view path) {
    return std::find_if(waiting_.begin(), waiting_.end(), [&](const waiting& w) {
        std::string scratch;
        return w.from == from && protocol::canonical_path(w.bind->noun, scratch) == path;
    });
}

bool pending_group_bindings::ask(const group_source& from, const identity& peer, const protocol::request_line& bind,
                                 time_point now) {
    std::string scratch;
    if (find(from, protocol::canonical_path(bind.noun, scratch)) != waiting_.end()) {
        return true;
    }
    if (waiting_.size() >= max_pending) {
        return false;
    }
    const auto place = waiting_.emplace(waiting_.end(), from, peer, bind);
    const auto decision = std::make_shared<bind_decision>(node_, [this, place](const protocol::failure* why_not) {
        std::list<waiting> decided; // it may be requested again at once
        decided.splice(decided.end(), waiting_, place);
        if (why_not == nullptr) { // otherwise nothing is answered in the group
            accepted_(place->from, *place->bind);
        }
    });
    place->decision = decision;
    decision->ask(*place->bind, place->peer, saturating_add(now, std::chrono::milliseconds{bind.deadline_ms}), now);
    return true;
}

void pending_group_bindings::drop(const group_source& from, const protocol::request_line& bind) {
    std::string scratch;
    const auto found = find(from, protocol::canonical_path(bind.noun, scratch));
    if (found != waiting_.end()) {
        std::list<waiting> gone;
        gone.splice(gone.end(), waiting_, found);
        gone.front().decision->withdraw();
    }
}

void pending_group_bindings::clear() {
    auto gone = std::exchange(waiting_, {});
    for (const auto& each : gone) {
        each.decision->withdraw();
    }
}

} // namespace cles::core
