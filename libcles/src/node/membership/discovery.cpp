// SPDX-License-Identifier: BSL-1.0
#include "node/membership/discovery.hpp"

#include <cles/error.hpp>

#include "node/local_node.hpp"
#include "node/membership/gossip.hpp"
#include "node/membership/name_conflict.hpp"
#include "node/routing/peer_channels.hpp"
#include "node/security_protocol.hpp"
#include "node/session/reserved_tasks.hpp"
#include "port/node_security.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>

namespace cles::core {

// -- when to announce ----------------------------------------------------------------------------------------------

void announcer::start(time_point now) {
    started_ = true;
    last_ = now - pause;
    announce_by(now);
}

// All known nodes answer the same solicitation, so the delay grows with their number.
void announcer::solicited(time_point now) {
    const auto all = static_cast<std::int64_t>(owner_.others()) + 1;
    const auto within = std::min<std::chrono::milliseconds>(answer_within, interval_per_node * all);
    announce_by(now + jitter_.quarter_of(within * 4));
}

void announcer::stop() noexcept {
    started_ = false;
    deadlines_.disarm(*this);
}

// An announcement is always complete, so an earlier one also replaces a later one.
void announcer::announce_by(time_point due) {
    due = std::max(due, last_ + pause);
    if (started_ && (!armed() || due < this->due())) {
        deadlines_.arm(*this, due);
    }
}

void announcer::on_deadline(time_point now) {
    const auto interval = interval_among(owner_.others());
    last_ = now;
    deadlines_.arm(*this, now + interval - jitter_.quarter_of(interval));
    owner_.announce(interval);
}

// -- how long names may become known -------------------------------------------------------------------------------

void discovery_grace::begin(time_point now, bool awaits_seeds) {
    over_ = false;
    is_for_seeds_ = false;
    awaits_seeds_ = awaits_seeds;
    deadlines_.arm(*this, now + length);
}

void discovery_grace::on_seeds_heard() {
    awaits_seeds_ = false;
    if (is_for_seeds_ && !over_) {
        stop();
        on_change_();
    }
}

void discovery_grace::stop() noexcept {
    over_ = true;
    deadlines_.disarm(*this);
}

void discovery_grace::on_deadline(time_point now) {
    over_ = !awaits_seeds_ || std::exchange(is_for_seeds_, true);
    if (!over_) {
        deadlines_.arm(*this, now + (for_seeds - length));
    }
    on_change_();
}

// -- start and end -------------------------------------------------------------------------------------------------

discovery::discovery(local_node& host, std::uint32_t seed)
    : host_(host), announcer_(*this, host.deadlines(), seed),
      discovery_grace_(host.deadlines(), [&host] { host.on_discovery_grace_changed(); }), seed_(seed * 7 + 3) {
    host.node().peers.watch(this);
    host.node().peers.set_prober(
        [this](std::uint64_t ticket, std::string_view url) { probe(ticket, std::string{url}); });
}

discovery::~discovery() {
    host_.node().peers.watch(nullptr);
    host_.node().peers.set_prober({});
    host_.node().gossip_responder = nullptr;
}

void discovery::join(multicast_group& through) {
    group_ = &through;
    group_->set_listener(this);
}

void discovery::check_links(const std::vector<std::string>& nodes) const {
    if (nodes.size() > max_links) {
        throw error(errc::invalid_option, "'links' has " + std::to_string(nodes.size()) + " names; at most 16 fit");
    }
    std::size_t bytes = 0;
    for (const auto& name : nodes) {
        bytes += name.size();
        if (bytes > max_links_bytes) { // announcements are datagrams
            throw error(errc::invalid_option, "the names in 'links' are too long together: more than 400 bytes");
        }
        if (!protocol::is_name(name) || protocol::is_reserved_target(name)) {
            throw error(errc::invalid_name, "in 'links', " + protocol::quoted(name) + " is not a node's name");
        }
        if (name == host_.node().name) {
            throw error(errc::invalid_option, "'links' contains the node itself, '" + name + "'");
        }
    }
}

void discovery::gossip(const gossip_options& how) {
    if (!gossip_ && how.part == nullptr) {
        if (!how.seeds.empty() || !how.links.empty()) {
            throw error(errc::invalid_option,
                        "gossip_options with seeds or links must be created by cles::gossip(seeds, links)");
        }
        return;
    }
    check_links(how.links);
    for (const auto& seed : how.seeds) {
        const auto where = parse_url(seed);
        if (!host_.environment().has_transport(where.scheme)) {
            throw error(errc::unknown_scheme, "'" + where.scheme + "' in '" + seed + "'");
        }
    }
    if (gossip_) {
        gossip_->set_seeds(how.seeds, host_.now());
        gossip_->reach().allow_only(how.links);
        announcer_.expedite(host_.now()); // the others respect the links
        host_.peer_channels().on_links_changed();
        return;
    }
    gossip_ = how.part->make(host_, seed_);
    gossip_->reach().allow_only(how.links);
    gossip_->set_seeds(how.seeds, host_.now());
    host_.node().gossip_responder = gossip_.get(); // from now on it answers the gossip requests of others
    start();
}

void discovery::start() {
    if (group_ == nullptr && !gossip_) {
        return;
    }
    if (!begun_) {
        discovery_grace_.expect();
    }
    host_.post_while_running([this](local_node&) { begin(); });
}

void discovery::begin() {
    const auto now = host_.now();
    if (!std::exchange(begun_, true)) {
        if (group_ != nullptr) {
            group_->send("BIND all:cles\n");
        }
        discovery_grace_.begin(now, gossip_ && gossip_->awaits_seeds());
        if (!left_) {
            announcer_.start(now);
        }
    }
    if (gossip_) {
        announcer_.expedite(now); // gossip sends this node's last announcement
        gossip_->start(now);
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
    const bool is_secured = host_.node().security != nullptr;
    if (is_secured && seq_ != 0) {
        announce(usual_interval, true); // gossip sends what was signed
    }
    if (gossip_) {
        gossip_->leave(host_.now());
    }
    if (group_ != nullptr && !is_secured && seq_ != 0) {
        announce(usual_interval, true);
    }
}

void discovery::stop() {
    host_.node().peers.watch(nullptr);
    host_.node().peers.set_prober({});
    leave();
    discovery_grace_.stop();
    if (gossip_) {
        gossip_->stop(host_.now());
        host_.node().gossip_responder = nullptr;
    }
    if (group_ != nullptr) {
        group_->set_listener(nullptr);
        group_ = nullptr;
    }
}

// -- announcements of this node ------------------------------------------------------------------------------------

void discovery::announce(std::chrono::milliseconds interval) {
    if (!host_.node().endpoints.empty()) { // otherwise no request could reach it
        announce(interval, false);
    }
    if (std::exchange(asks_again_, false) && group_ != nullptr) {
        group_->ask_again();
    }
}

void discovery::announce(std::chrono::milliseconds interval, bool leaving) {
    auto& node = host_.node();
    std::string tasks;
    json_writer w{tasks};
    write_tasks(w, node);
    announcement said{.node = node.name,
                      .load = node.load_now(),
                      .interval = interval,
                      .tasks = digest_of_tasks(tasks),
                      .leaving = leaving,
                      .pool = node.peers.pool(),
                      .roster = node.security ? node.security->roster_version() : 0,
                      .signed_tasks = node.security ? node.tasks.signed_tasks() : std::vector<std::string>{},
                      .links = gossip_ ? gossip_->reach().allowed() : std::vector<std::string>{}};
    if (node.security) {
        announce_signed(said);
        return;
    }
    ++seq_;
    if (gossip_ && !leaving) {
        said.endpoints = endpoints_for_gossip();
        node.peers.announce_self(said, seq_, host_.now());
    }
    if (group_ != nullptr) {
        announce_to_group(said);
    }
}

// By each interface with the endpoints usable there, and with the same `seq`, since it is one announcement.
void discovery::announce_to_group(announcement& said) {
    auto& node = host_.node();
    said.sources = sources_in_group();
    bool sent = false;
    for (auto* port : group_->ports()) {
        said.endpoints = endpoints_for_group(port->source().is_loopback());
        std::string line;
        append_announcement(line, said, seq_, node.epoch);
        sent = group_->send(*port, line) || sent;
    }
    node.counts.announcements_sent += sent ? 1 : 0;
}

// The same by all interfaces and by gossip.
void discovery::announce_signed(announcement& said) {
    auto& node = host_.node();
    said.endpoints =
        node.secured->endpoints(group_ != nullptr ? group_->ports() : std::vector<group_port*>{}, gossip_ != nullptr);
    if (group_ != nullptr) {
        said.sources = sources_in_group();
    }
    const auto line = node.secured->announce(said, seq_, group_ != nullptr, gossip_ != nullptr);
    if (gossip_) {
        node.peers.announce_self(said, seq_, host_.now());
    }
    if (group_ != nullptr) {
        node.counts.announcements_sent += group_->send(line) ? 1 : 0;
    }
}

// In a secured fleet always, so that nobody can repeat an announcement from another source.
std::vector<group_source> discovery::sources_in_group() const {
    std::vector<group_source> result;
    if (const auto& ports = group_->ports(); ports.size() > 1 || host_.node().security) {
        for (const auto* port : ports) {
            result.push_back(port->source());
        }
    }
    return result;
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
    if (const auto& secured = host_.node().secured) {
        secured->on_solicited();
    }
    if (by_name) {
        announcer_.expedite(now); // no other node answers
    } else {
        announcer_.solicited(now);
    }
}

// -- announcements of other nodes ----------------------------------------------------------------------------------

void discovery::on_announcement(heard_announcement heard, time_point now) {
    auto& counts = host_.node().counts;
    auto& [said, epoch, seq, from, again] = heard;
    if (!group_->is_of_this_host(from)) { // the loopback of another host
        std::erase_if(said.sources, [](const group_source& each) { return each.is_loopback(); });
    }
    switch (host_.node().peers.apply_announcement(said, epoch, seq, from, now, again)) {
    case membership::verdict::taken:
        ++counts.announcements_received;
        if (const auto& secured = host_.node().secured) {
            secured->on_stated_roster(said.node, said.roster, now);
        }
        break;
    case membership::verdict::duplicate: ++counts.group_repeated; break;
    case membership::verdict::copied: ++counts.group_copied; break;
    case membership::verdict::old: ++counts.announcements_dropped; break;
    case membership::verdict::refused: ++counts.peers_refused; break;
    case membership::verdict::foreign:
        ++counts.announcements_foreign;
        group_->ignore_until(from, now + said.interval * 15);
        break;
    case membership::verdict::own:
    case membership::verdict::unknown: break;
    }
}

void discovery::expedite_announcement() {
    if (begun_ && !left_) {
        announcer_.expedite(host_.now());
    }
}

// The others learn at once from where it sends now, and where it can be reached.
void discovery::on_interfaces_changed(time_point now) {
    if (begun_ && !left_) {
        asks_again_ = host_.node().security != nullptr;
        announcer_.expedite(now);
    }
}

// Called from inside a loop over all nodes, so log entries are posted. Without security, anybody can make up nodes: a
// minute brings no more lines than nodes may be known.
void discovery::on_peer(std::string_view node, membership::change what, std::string_view where) {
    const std::string name{node};
    const auto place =
        where.empty() ? std::string{" at no address that is reachable from here"} : " at " + std::string{where};
    const auto note = [this](log_level level, const std::string& text) {
        host_.node().log_caused({.level = level,
                                 .kind = level == log_level::debug ? "nodes, in detail" : "nodes",
                                 .most = static_cast<std::uint32_t>(host_.bounds().peers)},
                                [&] { return text; });
    };
    const auto note_clash = [&](log_level level, std::string_view kind, const std::string& text) {
        constexpr std::uint32_t most = 4;
        host_.node().log_caused({.level = level, .kind = kind, .source = name, .most = most}, [&] { return text; });
    };
    switch (what) {
    case membership::change::appeared: note(log_level::info, "discovered " + name + place); break;
    case membership::change::moved:
        note(log_level::info, name + " is now" + place);
        if (group_ != nullptr) { // what was bound at its old address may have ended with it
            group_->feeds().rebind_soon(name, host_.now());
        }
        break;
    case membership::change::silent: note(log_level::debug, name + " is no longer received"); break;
    case membership::change::returned: note(log_level::debug, name + " is received again"); break;
    case membership::change::left: note(log_level::info, name + " has left"); break;
    case membership::change::gone:
        note(log_level::info, name + " is gone");
        if (gossip_) {
            gossip_->on_gone(node, where, host_.now());
        }
        break;
    case membership::change::relinked:
        note(log_level::debug, name + " states other links");
        if (gossip_) {
            gossip_->reach().on_links_announced(name);
        }
        break;
    case membership::change::clash:
        note_clash(log_level::warning, "clash",
                   name == host_.node().name ? "another node also has the name '" + name + "', on " + std::string{where}
                                             : "a second node has the name '" + name + "', on " + std::string{where} +
                                                   ", and gets no requests");
        return;
    case membership::change::taken:
        note_clash(log_level::error, "taken",
                   "the name '" + name + "' is already in use: the node at " + std::string{where} +
                       " had it first, and gets its requests");
        host_.on_name_taken(std::string{where});
        return;
    }
    follow_incarnation(name);
    host_.peer_channels().on_address_changed(name);
}

// When a name has a new incarnation, its feeds bind to that one at once.
void discovery::follow_incarnation(const std::string& name) {
    const auto known = host_.node().peers.find_member(name);
    if (!known) { // the next incarnation may still follow
        if (gossip_) {
            gossip_->reach().on_new_incarnation(name);
        }
        return;
    }
    const auto [at, is_new] = incarnations_.try_emplace(name, known->epoch);
    const bool another = std::exchange(at->second, known->epoch) != known->epoch;
    if (incarnations_.size() > 2 * host_.bounds().peers + 1) {
        std::erase_if(incarnations_, [&](const auto& run) { return !host_.node().peers.address_of(run.first); });
    }
    if (is_new || another) {
        if (gossip_) {
            gossip_->reach().on_new_incarnation(name);
        }
        host_.feeds().on_new_incarnation(name, another);
        if (group_ != nullptr) {
            group_->feeds().rebind_soon(name, host_.now());
        }
    }
}

// The reply is used in a task of its own, because the link that delivered it must be done with it before it is released
// and others are notified.
void discovery::probe(std::uint64_t ticket, const std::string& url) {
    // In a fleet, only the node that has the name can answer.
    const std::string name{host_.node().security ? host_.node().peers.probed_name(ticket) : std::string_view{}};
    if (gossip_ && gossip_->reach().is_beyond(host_.node().peers.probed_name(ticket))) { // it cannot be asked from here
        host_.post_while_running(
            [ticket](local_node& alive) { alive.node().peers.on_probed(ticket, {}, alive.now()); });
        return;
    }
    const auto use_later = [ticket, url, name](local_node& host, const peer_answer& answer) {
        auto found = !answer.refusal.empty() ? probe_outcome{}
                     : answer.code           ? failed_probe(answer.code)
                                             : read_probe_answer(answer.json);
        host.post_while_running([ticket, url, name, found = std::move(found)](local_node& alive) {
            alive.node().peers.on_probed(ticket, found, alive.now());
            alive.peer_channels().release(url, name);
        });
    };
    host_.peer_channels().send({.target = name, .at = url, .expected = name}, {.verb = verb::pull, .noun = "self:cles"},
                               host_.now() + name_conflicts::probe_limit, host_.reply_while_running(use_later, true));
}

bool discovery::expects_more_of(std::string_view node) const noexcept {
    const auto* const run = discovery_grace_.over() ? nullptr : host_.node().peers.announced(node);
    return run != nullptr && run->endpoints.empty() && run->announced.sources.size() > 1;
}

std::string discovery::unknown_reason() const {
    if (group_ == nullptr || group_->ports().empty()) {
        return gossip_ ? "no node that it asks knows that name; " : "";
    }
    const bool others = host_.node().counts.announcements_foreign != 0;
    return "no node with that name has announced itself on " + group_->interfaces() +
           (others ? ", where there are nodes of other pools too; " : "; ");
}

} // namespace cles::core
