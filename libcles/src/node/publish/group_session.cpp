// SPDX-License-Identifier: BSL-1.0
#include "node/publish/group_session.hpp"

#include "node/base/deadlines.hpp"
#include "node/publish/multicast_group.hpp"
#include "node/session/request_checks.hpp"

#include <chrono>

namespace cles::core {

namespace {

identity identity_of(const group_datagram& datagram) {
    return {.transport = "multicast",
            .address = "udp://" + to_text(datagram.from),
            .name = std::string{datagram.member},
            .uid = {},
            .local = datagram.from.is_loopback()};
}

std::pair<group_source, std::string> key_of(const group_source& from, const protocol::request_line& bind) {
    std::string scratch;
    return {from, std::string{protocol::canonical_path(bind.noun, scratch)}};
}

} // namespace

group_session::group_session(std::shared_ptr<node_state> host, multicast_group& group, std::shared_ptr<group_port> port,
                             std::uint32_t seed)
    : node_(std::move(host)), group_(group), port_(std::move(port)), bindings_(*node_, *port_, seed) {
    group_.add(*port_);
}

group_session::~group_session() {
    stop();
    group_.remove(*port_);
}

void group_session::stop() {
    for (const auto& [key, each] : std::exchange(waiting_, {})) {
        each.handler->withdraw();
    }
    bindings_.clear();
    port_->close();
}

void group_session::on_writable() {
    const auto keep = group_.keep_owner();
    bindings_.drain(node_->time.now());
}

void group_session::on_datagram(const group_datagram& datagram) {
    const auto keep = group_.keep_owner();
    if (!group_.is_own(datagram.from)) {
        ++node_->counts.group_received;
        if (datagram.request == nullptr || !serve(datagram, node_->time.now())) {
            ++node_->counts.group_dropped;
        }
    }
    node_->completions.rethrow();
}

bool group_session::serve(const group_datagram& datagram, time_point now) {
    const auto& request = *datagram.request;
    const auto target = request.noun.target;
    if (group_.is_copy(datagram)) {
        ++node_->counts.group_copied;
        return true;
    }
    if (request.is_update()) {
        return !protocol::is_reserved_target(target) && group_.take(datagram, now);
    }
    return request.verb == verb::bind && (target == "all" || !protocol::is_reserved_target(target)) &&
           datagram.accept() && on_bind(datagram, request, now);
}

bool group_session::on_bind(const group_datagram& datagram, const protocol::request_line& bind, time_point now) {
    const auto& noun = bind.noun;
    const bool solicits = noun.task == "cles";
    if (solicits && !noun.parameters.empty()) {
        return false;
    }
    const bool by_name = noun.target != "all";
    if (by_name && noun.target != node_->name) { // for another node
        return true;
    }
    // `allows` leaves the target `all` to the nodes that are asked.
    const auto peer = identity_of(datagram);
    if (!permits(*node_, origin_of(*node_, peer, bind), node_->name, verb::bind, noun) || !allows(*node_, peer, bind)) {
        log_denial(*node_, peer, bind, "by multicast, where nothing is answered");
        return false;
    }
    if (!solicits) {
        return !group_.is_ignored(datagram.from, now) && bind_noun(datagram, bind, now);
    }
    group_.solicited(by_name, now);
    return true;
}

// Subject to the handler for BIND if there is one.
bool group_session::bind_noun(const group_datagram& datagram, const protocol::request_line& bind, time_point now) {
    const auto& from = datagram.from;
    const auto peer = identity_of(datagram);
    if (bind.unbinds()) {
        withdraw(from, bind);
    } else if (is_bind_decided_later(*node_, bind)) {
        return ask(from, peer, bind, now);
    } else {
        try {
            ask_bind_handler(*node_, peer, bind);
        } catch (...) { // nothing is answered in the group
            return false;
        }
    }
    return bindings_.bind(from, bind, now);
}

// Returns false if too many wait. A repeat of one that waits does not count.
bool group_session::ask(const group_source& from, const identity& peer, const protocol::request_line& bind,
                        time_point now) {
    auto key = key_of(from, bind);
    if (waiting_.contains(key)) {
        return true;
    }
    if (waiting_.size() >= max_pending) {
        return false;
    }
    const auto place = waiting_.try_emplace(std::move(key), peer, bind).first;
    const auto handler =
        std::make_shared<local_request>(node_, [this, place](std::string_view, const subrequest_failure* why_not) {
            const auto decided = waiting_.extract(place); // it may be requested again at once
            // Otherwise nothing is answered in the group.
            if (why_not == nullptr && !bindings_.bind(decided.key().first, *decided.mapped().bind, node_->time.now())) {
                ++node_->counts.group_dropped;
            }
        });
    auto& asked = place->second;
    asked.handler = handler;
    handler->run(*asked.bind, asked.peer, saturating_add(now, std::chrono::milliseconds{bind.deadline_ms}), now);
    return true;
}

// The binding is no longer wanted.
void group_session::withdraw(const group_source& from, const protocol::request_line& bind) {
    if (const auto gone = waiting_.extract(key_of(from, bind)); !gone.empty()) {
        gone.mapped().handler->withdraw();
    }
}

} // namespace cles::core
