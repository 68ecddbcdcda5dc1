// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/world.hpp"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr seconds memory_of_datagrams{75}; // and a margin: then remembered datagrams are forgotten
constexpr seconds probing{10};
constexpr seconds rebooting{4};
constexpr seconds quiet{300};

limits small_limits(bool secured) {
    limits bounds;
    bounds.line = secured ? 4096 : 2048; // longer than a roster
    bounds.links = 64;
    bounds.in_flight = 24;
    bounds.bindings = 8;
    bounds.running = 40;
    bounds.unread = 8192;
    bounds.waiting = 4096;
    bounds.binding_bytes = 16384;
    bounds.remembered = 40'000;
    bounds.feed = 16;
    bounds.stall = seconds{5};
    bounds.lease = seconds{3};
    bounds.connect = seconds{2};
    return bounds;
}

// A deliberate error: state that outlives a world.
std::uint64_t leak(planted fault) {
    static std::uint64_t leaked = 0;
    return fault == planted::chance_leaks ? ++leaked : 0;
}

} // namespace

bool report::broke(rule which) const noexcept {
    return std::any_of(violations.begin(), violations.end(), [which](const auto& v) { return v.broken == which; });
}

world::world(const plan& what, planted fault, witness::reader reader)
    : node_hosts(what.seed + leak(fault), fault), plan_(what), runs_(what.hosts) {
    watcher_.read_by(std::move(reader));
    parts_.add(make_asking(*this));
    parts_.add(make_following(*this));
    if (!plan_.secured) { // clients without a key get no answer
        parts_.add(make_talking(*this));
    }
    parts_.add(make_neighbouring(*this));
    if (!plan_.secured) {
        return;
    }
#if CLES_SIMULATION_SECURED
    net_.secure();
    auto made = make_securing(*this);
    securing_ = made.get();
    parts_.add(std::move(made));
#else
    throw std::runtime_error{"this simulation is built without security"};
#endif
}

std::shared_ptr<node_run> world::make(const std::string& name, unsigned host, unsigned run) {
    std::shared_ptr<simulated_security> security;
    std::map<std::string, std::string> peers;
    if (securing_ != nullptr) {
        security = securing_->equip(host);
        if (!security) {
            return nullptr;
        }
        for (unsigned other = 0; other < hosts(); ++other) {
            peers.emplace(name_of(other), net_.url_of(other, carrier::datagram));
        }
    }
    return std::make_shared<node_run>(
        net_, host, run, name,
        node_run::options{.seed = chance_.next(),
                          .bounds = plan_.small_limits ? small_limits(plan_.secured) : limits{},
                          .strangers = plan_.strangers,
                          .multicast = plan_.group,
                          .judges = &parts_,
                          .security = std::move(security),
                          .peers = std::move(peers)});
}

void world::start(unsigned host) {
    nodes_[host] = make(name_of(host), host, runs_[host] + 1);
    if (nodes_[host] == nullptr) {
        constexpr milliseconds until_next_try{500};
        time_.later(until_next_try, [this, host] {
            if (node(host) == nullptr) {
                start(host);
            }
        });
        return;
    }
    ++runs_[host];
    auto& n = *nodes_[host];
    watcher_.saw(n.name(), "starts", n.node()->epoch);
    n.start();
    parts_.each(&part::on_start, n);
}

std::shared_ptr<node_run> world::begin_namesake(const std::string& name, unsigned host, unsigned run) {
    auto n = make(name, host, run);
    watcher_.saw(name, "has a namesake", n->node()->epoch);
    n->start();
    return n;
}

void world::end_run(node_run& n) {
    n.crash();
    parts_.each(&part::on_crash, n);
    collect(n);
}

void part::complain(rule which, const std::string& what) { world_.watcher().broken(which, what); }

// -- faults --------------------------------------------------------------------------------------------------------

void world::perform(const action& a) {
    parts_.each(&part::perform, a);
    switch (a.what) {
    case deed::crash: crash(a["host"], milliseconds{a["down"]}); break;
    case deed::freeze: freeze(a["host"], milliseconds{a["for"]}); break;
    case deed::jump: jump(a["host"], milliseconds{a["ahead"]}); break;
    case deed::depart: depart(a["host"], milliseconds{a["down"]}); break;
    case deed::retire: retire(a["host"], milliseconds{a["limit"]}, milliseconds{a["down"]}); break;
    case deed::cut: net_.cut(a["host"], a["which"]); break;
    case deed::part:
        watcher_.saw("net", "is parted");
        net_.part(a["a"], a["b"], time_.now() + milliseconds{a["for"]});
        break;
    case deed::mute:
        watcher_.saw("net", "is parted one way");
        net_.mute(a["from"], a["to"], time_.now() + milliseconds{a["for"]});
        break;
    case deed::weather:
        watcher_.saw("net", "changes");
        net_.set({.lost = a["lost"],
                  .doubled = a["doubled"],
                  .late = a["late"],
                  .least = milliseconds{a["least"]},
                  .spread = milliseconds{a["spread"]}});
        break;
    default: break;
    }
}

void world::crash(unsigned host, milliseconds down) {
    auto& leaving = departures_[host];
    if (leaving.run == runs_[host]) {
        leaving.until = std::min(leaving.until, time_.now());
    }
    end_node(host, down);
}

void world::depart(unsigned host, milliseconds down) {
    if (auto* n = active(host); has_group() && n != nullptr) {
        n->stop();
        crash(host, down);
    }
}

void world::retire(unsigned host, milliseconds limit, milliseconds down) {
    auto* n = active(host);
    if (n == nullptr || n->local().closing()) {
        return;
    }
    watcher_.saw(n->name(), "leaves in order");
    departures_[host] = {runs_[host], time_.now(), time_.now() + limit};
    parts_.each(&part::on_leaving, *n);
    const auto end = [this, host, down, run = runs_[host]] {
        if (runs_[host] == run) {
            end_node(host, down);
        }
    };
    n->run([&] { n->local().close(limit, when_ended([this, end](std::string_view) { time_.at(time_.now(), end); })); });
    end_departure_by(*n, limit + n->bounds().discard + milliseconds{100}, end);
}

void world::end_departure_by(node_run& n, milliseconds span, const agenda::action& end) {
    n.later(span, [this, &n, end] {
        // A node that was suspended notices its deadlines late.
        const auto late_until = n.thawed_at() + n.bounds().discard + milliseconds{100};
        if (time_.now() < late_until) {
            end_departure_by(n, std::chrono::ceil<milliseconds>(late_until - time_.now()), end);
            return;
        }
        watcher_.broken(rule::ends_in_time, n.name() + " has not left in time");
        end();
    });
}

// -- a run ---------------------------------------------------------------------------------------------------------

void world::collect(node_run& n) {
    for (const auto count : n.node()->counts.requests) {
        report_.requests += count;
    }
    report_.updates += n.node()->counts.updates_received;
}

report world::live() {
    for (unsigned host = 0; host < hosts(); ++host) {
        start(host);
    }
    time_.watch([this] { check_next(hosts()); });
    const auto begun = time_.now();
    auto last = begun;
    for (const auto& a : plan_.actions) {
        last = std::max(last, begun + milliseconds{a.at_ms});
        time_.at(begun + milliseconds{a.at_ms}, [this, &a] { perform(a); });
    }
    time_.run_until(last + milliseconds{1});
    report_.node_seconds = std::chrono::duration<double>(time_.now() - begun).count() * hosts();
    watcher_.saw("world", "the trouble is over");
    parts_.each(&part::on_mending);
    end_trouble();
    parts_.each(&part::on_calm);
    pass(memory_of_datagrams);
    parts_.each(&part::probe);
    pass(probing);
    parts_.each(&part::judge_probe);
    if (secured()) {
        parts_.each(&part::reboot);
        pass(rebooting);
    }
    parts_.each(&part::wind_down);
    pass(quiet);
    parts_.each(&part::judge_rest);
    for (const auto& [host, n] : nodes_) {
        n->check_rest();
        collect(*n);
    }
    report_.violations = watcher_.violations();
    report_.hash = watcher_.hash();
    report_.steps = time_.steps();
    report_.datagrams = net_.datagrams();
    report_.stream_bytes = net_.stream_bytes;
    return report_;
}

} // namespace cles::simulation
