// SPDX-License-Identifier: BSL-1.0
#include "shell/neighbours.hpp"

#include <cles/error.hpp>

#include "shell/group.hpp"
#include "shell/local_node.hpp"
#include "shell/probe_reply.hpp"
#include "shell/route.hpp"

#include <utility>

namespace cles::shell {

neighbours::neighbours(local_node& host, std::uint32_t seed)
    : host_(host), announcer_(*this, host.deadlines(), seed), round_(*this, host.deadlines()), seed_(seed * 7 + 3) {
    host.node().others.watch(this);
    host.node().others.probe_by(this);
}

neighbours::~neighbours() {
    host_.node().others.watch(nullptr);
    host_.node().others.probe_by(nullptr);
}

void neighbours::join(group& through) {
    group_ = &through;
    group_->intake().attend(this);
}

void neighbours::gossip(const gossip_options& how) {
    if (gossiper_) {
        gossiper_->set_seeds(how.seeds);
        host_.settle();
    } else if (how.part != nullptr) {
        auto made = how.part->make(host_, seed_);
        made->set_seeds(how.seeds);
        gossiper_ = std::move(made);
        start();
    } else if (!how.seeds.empty()) {
        throw error(errc::invalid_option, "gossip_options has seeds but no part: make it by cles::gossip({seeds})");
    }
}

void neighbours::start() {
    if (group_ == nullptr && !gossiper_) {
        return;
    }
    if (!begun_) {
        round_.expect();
    }
    core::post(host_.environment(), [weak = host_.weak_from_this(), this] {
        if (const auto host = weak.lock(); host && !host->stopped()) {
            begin();
        }
    });
}

void neighbours::begin() {
    const auto now = host_.now();
    if (!std::exchange(begun_, true)) {
        if (group_ != nullptr) {
            group_->send("BIND all:cles\n");
        }
        round_.begin(now);
        if (!left_) {
            announcer_.start(now);
        }
    }
    if (gossiper_) {
        announcer_.hurry(now); // those who are asked are told of this node
        gossiper_->start();
    }
    host_.settle();
}

void neighbours::ask_for(std::string_view node) {
    if (group_ != nullptr) {
        group_->send("BIND " + std::string{node} + ":cles\n");
    }
}

void neighbours::leave() {
    if (std::exchange(left_, true)) {
        return;
    }
    announcer_.stop();
    if (gossiper_) {
        gossiper_->leave();
    }
    if (group_ != nullptr && seq_ != 0) {
        announce(core::announcer::shortest, true);
    }
}

void neighbours::stop() {
    host_.node().others.watch(nullptr);
    host_.node().others.probe_by(nullptr);
    leave();
    round_.stop();
    if (gossiper_) {
        gossiper_->stop();
    }
    if (group_ != nullptr) {
        group_->intake().attend(nullptr);
        group_ = nullptr;
    }
}

// -- what this node says -------------------------------------------------------------------------------------------

void neighbours::announce(std::chrono::milliseconds interval) {
    if (!host_.node().endpoints.empty()) { // else nobody could ask it for anything
        announce(interval, false);
    }
}

void neighbours::announce(std::chrono::milliseconds interval, bool leaving) {
    auto& node = host_.node();
    std::string tasks;
    json_writer w{tasks};
    write_tasks(w, node);
    core::announcement said{.node = node.name,
                            .load = node.load_now(),
                            .interval = interval,
                            .tasks = core::digest_of_tasks(tasks),
                            .leaving = leaving,
                            .pool = node.others.pool()};
    ++seq_;
    if (gossiper_ && !leaving) {
        said.endpoints = endpoints_for_gossip();
        node.others.speak(said, seq_, host_.now());
    }
    if (group_ != nullptr) {
        announce_to_group(said);
    }
}

// By each interface with the endpoints that are of use there, and with the same number: it is one word.
void neighbours::announce_to_group(core::announcement& said) {
    auto& node = host_.node();
    if (const auto& own = group_->intake().own(); own.size() > 1) {
        said.sources = own;
    }
    bool sent = false;
    for (auto& place : group_->places()) {
        said.endpoints = endpoints_for_group(place.source().is_loopback());
        std::string line;
        append_announcement(line, said, seq_, node.epoch);
        sent = place.send(line) || sent;
    }
    node.counts.announcements_sent += sent ? 1 : 0;
}

// Those who hear of them from others pass over what they cannot use.
std::vector<std::string> neighbours::endpoints_for_gossip() const {
    std::vector<std::string> result;
    for (const auto& endpoint : host_.node().endpoints) {
        if (!endpoint.starts_with("inproc:")) {
            result.push_back(endpoint);
        }
    }
    return result;
}

// What others in the group can use by that interface: on loopback all but what stays in this process, elsewhere what
// other hosts reach.
std::vector<std::string> neighbours::endpoints_for_group(bool loopback) const {
    std::vector<std::string> result;
    for (const auto& endpoint : host_.node().endpoints) {
        auto where = parse_url(endpoint);
        if (where.scheme == "inproc") {
            continue;
        }
        if (where.host == "::") { // which takes IPv6 alone, so that it is not where the announcement comes from
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

std::size_t neighbours::others() const { return host_.node().others.size(); }

void neighbours::on_solicitation(bool by_name, time_point now) {
    if (by_name) {
        announcer_.hurry(now); // nobody else answers
    } else {
        announcer_.solicited(now);
    }
}

// -- what others say -----------------------------------------------------------------------------------------------

void neighbours::on_announcement(const core::group_source& from, const protocol::request_line& update, time_point now) {
    auto& counts = host_.node().counts;
    core::announcement said;
    std::string why;
    if (!read_announcement(update, said, why)) {
        ++counts.announcements_dropped;
        host_.say_soon(log_level::debug, "an announcement from " + host_text(from) + " was dropped: " + why);
        return;
    }
    if (!group_->intake().is_of_this_host(from)) { // what is loopback there is another's here
        std::erase_if(said.sources, [](const core::group_source& each) { return each.is_loopback(); });
    }
    switch (host_.node().others.hear(said, *update.epoch, *update.seq, from, now)) {
    case core::presence::verdict::taken: ++counts.announcements_received; break;
    case core::presence::verdict::again: ++counts.group_repeated; break;
    case core::presence::verdict::old: ++counts.announcements_dropped; break;
    case core::presence::verdict::refused: ++counts.peers_refused; break;
    case core::presence::verdict::foreign:
        ++counts.announcements_foreign;
        group_->intake().pass_over(from, now + said.interval * 15);
        break;
    case core::presence::verdict::own:
    case core::presence::verdict::unknown: break;
    }
}

// Told from inside a search through all nodes.
void neighbours::on_peer(std::string_view node, core::presence::change what, std::string_view where) {
    const std::string name{node};
    const auto place =
        where.empty() ? std::string{", at no address that can be used from here"} : ", at " + std::string{where};
    switch (what) {
    case core::presence::change::appeared: host_.say_soon(log_level::info, name + " is there" + place); break;
    case core::presence::change::moved: host_.say_soon(log_level::info, name + " is elsewhere now" + place); break;
    case core::presence::change::silent: host_.say_soon(log_level::debug, name + " is not heard any more"); break;
    case core::presence::change::returned: host_.say_soon(log_level::debug, name + " is heard again"); break;
    case core::presence::change::left: host_.say_soon(log_level::info, name + " has left"); break;
    case core::presence::change::gone:
        host_.say_soon(log_level::info, name + " is gone");
        if (gossiper_) {
            gossiper_->on_gone(node, where, host_.now());
        }
        break;
    case core::presence::change::clash:
        host_.say_soon(log_level::warning,
                       name == host_.node().name
                           ? "another node calls itself '" + name + "' too, on " + std::string{where}
                           : "there is a second '" + name + "', on " + std::string{where} + ", and it is not asked");
        if (name != host_.node().name) {
            host_.routes().on_whereabouts(name);
        }
        return;
    case core::presence::change::taken: on_name_taken(std::string{where}); return;
    }
    follow_run(name);
    host_.routes().on_whereabouts(name);
}

// Feeds of a run that is over are bound anew at the next one at once.
void neighbours::follow_run(const std::string& name) {
    const auto known = host_.node().others.look(name);
    if (!known) {
        return; // the next one may still come
    }
    const auto [at, is_new] = runs_.try_emplace(name, known->epoch);
    const bool another = std::exchange(at->second, known->epoch) != known->epoch;
    if (runs_.size() > 2 * host_.bounds().peers + 1) {
        std::erase_if(runs_, [&](const auto& run) { return !host_.node().others.find(run.first); });
    }
    if (is_new || another) {
        host_.feeds().on_new_run(name, another);
        if (group_ != nullptr) {
            group_->intake().feeds().on_new_run(name, host_.now());
        }
    }
}

void neighbours::on_name_taken(const std::string& where) {
    host_.say_soon(log_level::error, "the name '" + host_.node().name + "' is taken: the node at " + where +
                                         " was there first, and is asked by it");
    host_.on_name_taken(where);
}

void neighbours::probe(std::uint64_t ticket, std::string_view url) {
    auto reply = detail::pending_ptr{new probe_reply{host_.weak_from_this(), ticket, std::string{url}}};
    boost::system::error_code code;
    std::string why;
    auto* way = host_.routes().to("self", url, false, code, why);
    if (way == nullptr) {
        host_.fail_later(std::move(reply), code, std::move(why));
        return;
    }
    const auto now = host_.now();
    way->send({.verb = verb::pull,
               .noun = "self:cles",
               .id = host_.draw_id(),
               .begun = now,
               .deadline = now + core::presence::probe_limit},
              std::move(reply), {});
    host_.settle();
}

void neighbours::on_round_over() { host_.on_round_over(); }

std::optional<std::string_view> neighbours::find(std::string_view node) const noexcept {
    return host_.node().others.find(node);
}

std::optional<std::string_view> neighbours::second_of(std::string_view node) const noexcept {
    return host_.node().others.second_of(node);
}

bool neighbours::expects_more_of(std::string_view node) const noexcept {
    const auto* const run = round_.over() ? nullptr : host_.node().others.announced(node);
    return run != nullptr && run->endpoints.empty() && run->said.sources.size() > 1;
}

std::string neighbours::why_unknown() const {
    if (group_ == nullptr) {
        return gossiper_ ? "no node that it asks knows of it; " : "";
    }
    const bool others = host_.node().counts.announcements_foreign != 0;
    return "nobody of that name has announced itself on " + group_->interfaces() +
           (others ? ", where there are nodes of other pools too; " : "; ");
}

} // namespace cles::shell
