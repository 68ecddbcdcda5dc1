// SPDX-License-Identifier: BSL-1.0
#include "node/membership/discovery.hpp"

#include <cles/error.hpp>

#include "node/local_node.hpp"
#include "node/membership/name_conflict.hpp"
#include "node/publish/multicast_group.hpp"
#include "node/routing/peer_channel.hpp"
#include "node/session/reserved_tasks.hpp"

#include <utility>

namespace cles::core {

discovery::discovery(local_node& host, std::uint32_t seed)
    : host_(host), announcer_(*this, host.deadlines(), seed), discovery_grace_(*this, host.deadlines()),
      seed_(seed * 7 + 3) {
    host.node().peers.watch(this);
    host.node().peers.set_prober(this);
}

discovery::~discovery() {
    host_.node().peers.watch(nullptr);
    host_.node().peers.set_prober(nullptr);
}

void discovery::join(multicast_group& through) {
    group_ = &through;
    group_->dispatcher().set_listener(this);
}

void discovery::gossip(const gossip_options& how) {
    if (gossip_driver_) {
        gossip_driver_->set_seeds(how.seeds);
    } else if (how.part != nullptr) {
        auto made = how.part->make(host_, seed_);
        made->set_seeds(how.seeds);
        gossip_driver_ = std::move(made);
        start();
    } else if (!how.seeds.empty()) {
        throw error(errc::invalid_option, "gossip_options has seeds but no part: make it by cles::gossip({seeds})");
    }
}

void discovery::start() {
    if (group_ == nullptr && !gossip_driver_) {
        return;
    }
    if (!begun_) {
        discovery_grace_.expect();
    }
    core::post(host_.environment(), [weak = host_.weak_from_this(), this] {
        if (const auto host = weak.lock(); host && !host->stopped()) {
            begin();
        }
    });
}

void discovery::begin() {
    const auto now = host_.now();
    if (!std::exchange(begun_, true)) {
        if (group_ != nullptr) {
            group_->send("BIND all:cles\n");
        }
        discovery_grace_.begin(now);
        if (!left_) {
            announcer_.start(now);
        }
    }
    if (gossip_driver_) {
        announcer_.expedite(now); // gossip sends this node's last announcement
        gossip_driver_->start();
    }
}

void discovery::solicit(std::string_view node) {
    if (group_ != nullptr) {
        group_->send("BIND " + std::string{node} + ":cles\n");
    }
}

void discovery::leave() {
    if (std::exchange(left_, true)) {
        return;
    }
    announcer_.stop();
    if (gossip_driver_) {
        gossip_driver_->leave();
    }
    if (group_ != nullptr && seq_ != 0) {
        announce(core::announcer::shortest, true);
    }
}

void discovery::stop() {
    host_.node().peers.watch(nullptr);
    host_.node().peers.set_prober(nullptr);
    leave();
    discovery_grace_.stop();
    if (gossip_driver_) {
        gossip_driver_->stop();
    }
    if (group_ != nullptr) {
        group_->dispatcher().set_listener(nullptr);
        group_ = nullptr;
    }
}

// -- announcements of this node ------------------------------------------------------------------------------------

void discovery::announce(std::chrono::milliseconds interval) {
    if (!host_.node().endpoints.empty()) { // otherwise no request could reach it
        announce(interval, false);
    }
}

void discovery::announce(std::chrono::milliseconds interval, bool leaving) {
    auto& node = host_.node();
    std::string tasks;
    json_writer w{tasks};
    write_tasks(w, node);
    core::announcement said{.node = node.name,
                            .load = node.load_now(),
                            .interval = interval,
                            .tasks = core::digest_of_tasks(tasks),
                            .leaving = leaving,
                            .pool = node.peers.pool()};
    ++seq_;
    if (gossip_driver_ && !leaving) {
        said.endpoints = endpoints_for_gossip();
        node.peers.announce_self(said, seq_, host_.now());
    }
    if (group_ != nullptr) {
        announce_to_group(said);
    }
}

// By each interface with the endpoints usable there, and with the same `seq`, since it is one announcement.
void discovery::announce_to_group(core::announcement& said) {
    auto& node = host_.node();
    if (const auto& own = group_->dispatcher().own(); own.size() > 1) {
        said.sources = own;
    }
    bool sent = false;
    for (auto& place : group_->endpoints()) {
        said.endpoints = endpoints_for_group(place.source().is_loopback());
        std::string line;
        append_announcement(line, said, seq_, node.epoch);
        sent = place.send(line) || sent;
    }
    node.counts.announcements_sent += sent ? 1 : 0;
}

// Readers ignore the endpoints that they cannot use.
std::vector<std::string> discovery::endpoints_for_gossip() const {
    std::vector<std::string> result;
    for (const auto& endpoint : host_.node().endpoints) {
        if (!endpoint.starts_with("inproc:")) {
            result.push_back(endpoint);
        }
    }
    return result;
}

// The endpoints that receivers on that interface can use: on loopback all except `inproc`, otherwise those that other
// hosts reach.
std::vector<std::string> discovery::endpoints_for_group(bool loopback) const {
    std::vector<std::string> result;
    for (const auto& endpoint : host_.node().endpoints) {
        auto where = parse_url(endpoint);
        if (where.scheme == "inproc") {
            continue;
        }
        if (where.host == "::") { // IPv6 only, but announcements come from an IPv4 address
            if (!loopback) {
                continue;
            }
            where.host = "::1";
        }
        if (loopback || host_.environment().is_exposed(where)) {
            result.push_back(to_string(where));
        }
    }
    return result;
}

std::size_t discovery::others() const { return host_.node().peers.size(); }

void discovery::on_solicitation(bool by_name, time_point now) {
    if (by_name) {
        announcer_.expedite(now); // no other node answers
    } else {
        announcer_.solicited(now);
    }
}

// -- announcements of other nodes ----------------------------------------------------------------------------------

void discovery::on_announcement(const core::group_source& from, const protocol::request_line& update, time_point now) {
    auto& counts = host_.node().counts;
    core::announcement said;
    std::string why;
    if (!read_announcement(update, said, why)) {
        ++counts.announcements_dropped;
        host_.post_log(log_level::debug, "an announcement from " + host_text(from) + " was dropped: " + why);
        return;
    }
    if (!group_->dispatcher().is_of_this_host(from)) { // the loopback of another host
        std::erase_if(said.sources, [](const core::group_source& each) { return each.is_loopback(); });
    }
    switch (host_.node().peers.apply_announcement(said, *update.epoch, *update.seq, from, now)) {
    case core::membership::verdict::taken: ++counts.announcements_received; break;
    case core::membership::verdict::duplicate: ++counts.group_repeated; break;
    case core::membership::verdict::old: ++counts.announcements_dropped; break;
    case core::membership::verdict::refused: ++counts.peers_refused; break;
    case core::membership::verdict::foreign:
        ++counts.announcements_foreign;
        group_->dispatcher().ignore_until(from, now + said.interval * 15);
        break;
    case core::membership::verdict::own:
    case core::membership::verdict::unknown: break;
    }
}

// Called from inside a loop over all nodes, so log entries are posted.
void discovery::on_peer(std::string_view node, core::membership::change what, std::string_view where) {
    const std::string name{node};
    const auto place =
        where.empty() ? std::string{", at no address that can be used from here"} : ", at " + std::string{where};
    switch (what) {
    case core::membership::change::appeared: host_.post_log(log_level::info, name + " is there" + place); break;
    case core::membership::change::moved: host_.post_log(log_level::info, name + " is elsewhere now" + place); break;
    case core::membership::change::silent: host_.post_log(log_level::debug, name + " is not heard any more"); break;
    case core::membership::change::returned: host_.post_log(log_level::debug, name + " is heard again"); break;
    case core::membership::change::left: host_.post_log(log_level::info, name + " has left"); break;
    case core::membership::change::gone:
        host_.post_log(log_level::info, name + " is gone");
        if (gossip_driver_) {
            gossip_driver_->on_gone(node, where, host_.now());
        }
        break;
    case core::membership::change::clash:
        host_.post_log(log_level::warning,
                       name == host_.node().name
                           ? "another node calls itself '" + name + "' too, on " + std::string{where}
                           : "there is a second '" + name + "', on " + std::string{where} + ", and it is not asked");
        if (name != host_.node().name) {
            host_.peer_channels().on_address_changed(name);
        }
        return;
    case core::membership::change::taken: on_name_taken(std::string{where}); return;
    }
    follow_incarnation(name);
    host_.peer_channels().on_address_changed(name);
}

// When a name has a new incarnation, its feeds bind to that one at once.
void discovery::follow_incarnation(const std::string& name) {
    const auto known = host_.node().peers.find_member(name);
    if (!known) {
        return; // the next incarnation may still follow
    }
    const auto [at, is_new] = incarnations_.try_emplace(name, known->epoch);
    const bool another = std::exchange(at->second, known->epoch) != known->epoch;
    if (incarnations_.size() > 2 * host_.bounds().peers + 1) {
        std::erase_if(incarnations_, [&](const auto& run) { return !host_.node().peers.address_of(run.first); });
    }
    if (is_new || another) {
        host_.feeds().on_new_incarnation(name, another);
        if (group_ != nullptr) {
            group_->dispatcher().feeds().on_new_incarnation(name, host_.now());
        }
    }
}

void discovery::on_name_taken(const std::string& where) {
    host_.post_log(log_level::error, "the name '" + host_.node().name + "' is taken: the node at " + where +
                                         " was there first, and is asked by it");
    host_.on_name_taken(where);
}

void discovery::probe(std::uint64_t ticket, std::string_view url) {
    auto reply = detail::pending_ptr{new probe_reply{host_.weak_from_this(), ticket, std::string{url}}};
    host_.peer_channels().send("self", url, {.verb = verb::pull, .noun = "self:cles"},
                               host_.now() + core::name_conflicts::probe_limit, std::move(reply), {});
}

void discovery::on_discovery_grace_over() { host_.on_discovery_grace_over(); }

std::optional<std::string_view> discovery::address_of(std::string_view node) const noexcept {
    return host_.node().peers.address_of(node);
}

std::optional<std::string_view> discovery::conflicting_endpoint_of(std::string_view node) const noexcept {
    return host_.node().peers.conflicting_endpoint_of(node);
}

bool discovery::expects_more_of(std::string_view node) const noexcept {
    const auto* const run = discovery_grace_.over() ? nullptr : host_.node().peers.announced(node);
    return run != nullptr && run->endpoints.empty() && run->announced.sources.size() > 1;
}

std::string discovery::unknown_reason() const {
    if (group_ == nullptr) {
        return gossip_driver_ ? "no node that it asks knows of it; " : "";
    }
    const bool others = host_.node().counts.announcements_foreign != 0;
    return "nobody of that name has announced itself on " + group_->interfaces() +
           (others ? ", where there are nodes of other pools too; " : "; ");
}

} // namespace cles::core
