// SPDX-License-Identifier: BSL-1.0
#include "node/secured/local_security.hpp"

#include "node/local_node.hpp"
#include "node/membership/gossip.hpp"
#include "node/routing/other_pools.hpp"
#include "node/routing/router.hpp"
#include "node/secured/roster_exchange.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <memory>
#include <utility>

namespace cles::core {

local_security::local_security(local_node& host) : host_(host) {
    auto& node = host_.node();
    node.security->begin(node.name, protocol::parse_epoch(node.epoch).value_or(0), host_.environment(), *this);
}

local_security::~local_security() { host_.node().security->end(); }

// In a task of its own: the line that brought the roster belongs to a link that may be closed.
void local_security::on_security_changed() {
    host_.post_while_running([this](local_node&) { apply_change(); });
}

void local_security::apply_change() {
    const auto& node = host_.node();
    if (const bool removed = !node.security->is_member(node.name);
        std::exchange(removed_, removed) != removed && removed) {
        host_.write_log(log_level::error, node.name + " was removed from the fleet by version " +
                                              std::to_string(node.security->roster_version()) + " of the roster");
    }
    host_.connections().on_security_changed();
    host_.feeds().on_security_changed();
    if (node.pools != nullptr) {
        node.pools->on_security_changed();
    }
    if (auto* const routes = node.gossip_responder) {
        routes->reach().on_rights_changed();
    }
    if (node.active_router != nullptr) {
        node.active_router->on_rights_changed();
    }
    host_.discovery().expedite_announcement();
}

void local_security::on_stated_roster(std::string_view name, std::uint32_t version) {
    ask_for_roster(name, version, host_.now());
}

void local_security::on_unanswered(std::string_view name, const std::vector<std::string>& endpoints) {
    for (const auto& where : endpoints) {
        if (where.starts_with("tls:")) { // both ends have the newer roster once the link is open
            visit(name, where);
            return;
        }
    }
}

// At an address that the node itself has announced.
void local_security::ask_for_roster(std::string_view node, std::uint32_t version, time_point now) {
    const auto& host = host_.shared_node();
    if (host->security->wants_roster(node, version, now)) {
        auto& channels = host_.peer_channels();
        const auto at = channels.is_by_datagram(node) ? channels.tls_address_of(node) : std::string{};
        pull_roster(node, at, make_roster_reply(host, std::string{node}));
    }
}

void local_security::pull_roster(std::string_view node, std::string_view at, detail::pending_ptr reply) {
    const auto noun = std::string{node} + ":cles/roster";
    host_.peer_channels().send({.target = node, .at = at}, {.verb = verb::pull, .noun = noun},
                               host_.now() + std::chrono::milliseconds{protocol::default_deadline_ms},
                               std::move(reply));
}

void local_security::visit(std::string_view node) {
    if (const auto where = host_.peer_channels().tls_address_of(node); !where.empty()) {
        visit(node, where);
    }
}

void local_security::visit(std::string_view node, const std::string& url) {
    auto release = host_.reply_while_running([url](local_node& host, const peer_answer&) {
        host.post_while_running([url](local_node& alive) { alive.peer_channels().release(url); });
    });
    pull_roster(node, url, std::move(release));
}

void local_security::on_due(time_point at) {
    if (!armed() || at < due()) {
        host_.deadlines().arm(*this, at);
    }
}

void local_security::on_deadline(time_point now) { host_.node().security->on_time(now); }

void local_security::on_security_log(log_level level, std::string text) { host_.post_log(level, std::move(text)); }

} // namespace cles::core
