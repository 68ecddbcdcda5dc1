// SPDX-License-Identifier: BSL-1.0
#include "simulation/workload/multicasting.hpp"

#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "simulation/network/group_port.hpp"
#include "simulation/workload/following.hpp"
#include "simulation/world/world.hpp"

#include <algorithm>
#include <utility>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;

constexpr const char* beacon = "beacon"; // published once by each run, and followed by nobody before the end
constexpr milliseconds soon{600};        // twice what a repeat is put off by, and the way

std::string group_path(unsigned noun) { return "fix/" + std::to_string(noun); }

} // namespace

void multicasting::on_start(node_run& n) {
    if (!world_.has_group()) {
        return;
    }
    n.node()->tasks.add(verb::bind, beacon, {});
    n.local().publish(
        beacon, [&](json_writer& w) { w.raw("{\"n\":1,\"run\":" + std::to_string(world_.runs(n.host())) + "}"); });
}

void multicasting::on_crash(node_run& n) {
    followers_.forget(n);
    std::erase_if(nouns_, [&](const auto& each) { return each.first.first == &n; });
}

void multicasting::perform(const action& a) {
    if (!world_.has_group()) {
        return;
    }
    switch (a.what) {
    case deed::gather: gather(a); break;
    case deed::hold: followers_.hold(a); break;
    case deed::leave: followers_.leave(a); break;
    default: break;
    }
}

void multicasting::gather(const action& a) {
    auto* n = world_.node(a["from"]);
    if (n != nullptr && !n->frozen() && !followers_.find(a["feed"])) {
        follow(*n, a["all"] != 0 ? "all" : world::name_of(a["to"]), group_path(a["noun"]), a["feed"], a["slow"]);
    }
}

std::shared_ptr<group_follower> multicasting::follow(node_run& n, const std::string& target, const std::string& path,
                                                     std::uint32_t label, std::uint32_t slow) {
    auto made = std::make_shared<group_follower>(n, label, target, path, milliseconds{slow});
    followers_.add(made);
    n.run([&] { made->start(); });
    return made;
}

// -- what crosses the group ----------------------------------------------------------------------------------------

void multicasting::on_group_heard(node_run& at, const core::group_source& from, std::string_view datagram) {
    if (datagram.ends_with('\n')) {
        datagram.remove_suffix(1);
    }
    protocol::request_line bind;
    protocol::malformed_request ignored;
    if (from == at.group()->source() || !protocol::parse_request(datagram, bind, ignored) || bind.verb != verb::bind ||
        bind.noun.task == "cles" || (bind.noun.target != "all" && bind.noun.target != at.name())) {
        return;
    }
    std::string scratch;
    auto& of = nouns_[{&at, std::string{protocol::canonical_path(bind.noun, scratch)}}];
    if (bind.unbinds()) {
        of.leases.erase(from);
        return;
    }
    auto& until = of.leases[from];
    of.newly_bound |= until <= at.now();
    until = at.now() + milliseconds{bind.lease_ms.value_or(protocol::default_lease_ms)};
}

void multicasting::on_group_sent(node_run& by, std::string_view line) {
    protocol::request_line update;
    protocol::malformed_request ignored;
    if (!protocol::parse_request(line.substr(0, line.size() - 1), update, ignored) || !update.is_update() ||
        update.noun.task == "cles") {
        return;
    }
    std::string scratch;
    const std::string path{protocol::canonical_path(update.noun, scratch)};
    auto& of = nouns_[{&by, path}];
    const auto complain = [&](const std::string& what) {
        world_.watcher().broken(rule::sent_once,
                                by.name() + " sends " + std::to_string(*update.seq) + " of " + path + " " + what);
    };
    const auto now = by.now();
    // One that was stopped goes through all that was due meanwhile.
    if (!by.was_frozen_until_now() &&
        std::none_of(of.leases.begin(), of.leases.end(), [now](const auto& l) { return l.second >= now; })) {
        complain("though nobody is bound");
    }
    if (*update.seq < of.sent) {
        complain("after " + std::to_string(of.sent));
    } else if (*update.seq == of.sent && !std::exchange(of.newly_bound, false)) {
        complain("again, and nobody is newly bound");
    }
    of.sent = *update.seq;
}

// -- judging -------------------------------------------------------------------------------------------------------

void multicasting::probe() {
    if (!world_.has_group()) {
        return;
    }
    std::vector<std::shared_ptr<group_follower>> newcomers;
    for (unsigned host = 0; host < world_.hosts(); ++host) {
        const auto target = host % 2 == 0 ? world::name_of((host + 1) % world_.hosts()) : "all";
        newcomers.push_back(follow(*world_.node(host), target, beacon, ++next_probe_, 0));
    }
    world_.time().at(world_.time().now() + soon, [this, newcomers] { judge_first(newcomers); });
}

void multicasting::judge_first(const std::vector<std::shared_ptr<group_follower>>& newcomers) {
    for (const auto& f : newcomers) {
        for (unsigned host = 0; host < world_.hosts(); ++host) {
            const auto name = world::name_of(host);
            if (f->wants(name) && f->last_of(name).run != world_.runs(host)) {
                world_.watcher().broken(rule::first_soon, f->name() + " has not got the last update of " + name);
            }
        }
    }
}

void multicasting::judge_probe() {
    for (const auto& f : followers_) {
        for (unsigned host = 0; f->is_open() && host < world_.hosts(); ++host) {
            const auto name = world::name_of(host);
            for (unsigned i = 0; i < 2; ++i) {
                const auto last = f->last_of(name);
                const auto published = published_.count(host, i);
                if (f->wants(name) && f->path() == group_path(i) &&
                    (last.run != world_.runs(host) || last.number != published)) {
                    world_.watcher().broken(rule::feeds_receive, f->name() + " has got " + std::to_string(last.number) +
                                                                     " of " + std::to_string(published) + " that " +
                                                                     name + " has published");
                }
            }
        }
    }
}

void multicasting::wind_down() {
    for (const auto& f : followers_) {
        f->at().run([&] { f->close(); });
    }
    followers_.clear();
}

} // namespace cles::simulation
