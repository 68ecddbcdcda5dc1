// SPDX-License-Identifier: BSL-1.0
#include "simulation/sharing.hpp"

#include <cles/gossip.hpp>
#include <cles/routing.hpp>

#include "node/membership/gossip.hpp"
#include "simulation/network/graph.hpp"
#include "simulation/world/daemon_hosts.hpp"

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace cles::simulation {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr unsigned jobs_per_second = 60; // per node, so that most nodes are idle
constexpr unsigned most_in_burst = 24;
constexpr std::size_t most_queued = 64; // of each node
constexpr unsigned vital_bursts = 50;
constexpr unsigned vital_burst = 16;
constexpr milliseconds vital_deadline{2000};
constexpr milliseconds until_found{1500}; // the nodes, and then the routes
constexpr milliseconds until_ended{5000}; // longer than any job takes
constexpr milliseconds drain_limit{1000};
constexpr milliseconds close_limit{500};

class sharing_mesh final : public daemon_hosts {
  public:
    sharing_mesh(std::uint64_t seed, const sharing_setup& setup, planted fault)
        : daemon_hosts(seed, fault, most_queued), setup_(setup),
          links_(graph::of(mesh_form::random, setup.nodes, setup.mean_degree, chance_)) {
        for (unsigned host = 0; host < setup.nodes; ++host) {
            start(host);
        }
        for (unsigned i = 0; i < std::max(1U, setup.nodes / 10); ++i) {
            busy_.push_back(any_host());
        }
        for (unsigned i = 0; i < setup.clients; ++i) {
            clients_.push_back({.entry = chance_.chance(500) ? any_busy() : any_host(),
                                .by = chance_.chance(250) ? carrier::datagram : carrier::stream});
            if (clients_.back().by == carrier::datagram) {
                steady_.insert(clients_.back().entry);
            }
            start(setup.nodes + i);
        }
        time_.watch([this] { check_next(setup_.nodes); });
    }

    work_report live() {
        const auto begun = time_.now();
        pass(until_found);
        if (setup_.faults_per_minute != 0) {
            net_.set({.lost = 5, .doubled = 5, .late = 5});
            time_.at(time_.now(), [this] { go_wrong(); });
        }
        for (bool whole = true; requests_.size() < setup_.jobs;) {
            const auto burst = chance_.chance(200) ? chance_.between(2, most_in_burst) : 1;
            submit_burst(burst, false);
            time_.run_until(time_.now() + burst * microseconds{1'000'000 / (jobs_per_second * setup_.nodes)});
            if (setup_.faults_per_minute != 0 && whole && requests_.size() > setup_.jobs / 2) {
                whole = false;
                cut_in_two();
            }
        }
        over_ = true;
        end_trouble();
        pass(until_ended);
        pass_until_routes();
        for (unsigned i = 0; i < vital_bursts; ++i) {
            submit_burst(vital_burst, true);
            pass(milliseconds{30});
        }
        pass(vital_deadline + seconds{1});
        requests_.judge();
        judge_rest();
        report_.jobs = requests_.tally();
        report_.seconds = std::chrono::duration<double>(time_.now() - begun).count();
        report_.violations = watcher_.violations();
        return report_;
    }

  private:
    struct client {
        unsigned entry = 0;
        carrier by = carrier::stream;
    };

    // -- nodes -----------------------------------------------------------------------------------------------------

    void start(unsigned host) override {
        const bool is_client = host >= setup_.nodes;
        node_run::options how{.seed = chance_.next()};
        if (!is_client) {
            std::vector<std::string> seeds;
            std::vector<std::string> names;
            for (const auto other : links_.of(host)) {
                seeds.push_back(net_.url_of(other, carrier::stream));
                names.push_back(mesh_name(other));
            }
            how.load = [this, host] { return pool_of(host).load(); };
            how.routing = cles::routing();
            how.gossip = cles::gossip(seeds, names);
        }
        const auto n = std::make_shared<node_run>(
            net_, host, ++runs_[host], is_client ? "client" + std::to_string(host) : mesh_name(host), std::move(how));
        nodes_[host] = n;
        if (!is_client) {
            add_pool(*n, true);
            offer(*n, verb::delegate, "once", false);
            offer(*n, verb::delegate, "again", true);
        }
        n->start();
    }

    work_pool::order order_of(const request& r, std::uint32_t op) override {
        if (r.body() != body_of(op)) {
            requests_.complain(rule::replies_match, op, "came with the body of another");
        }
        return {.requester = r.parameter<std::uint64_t>(2), .heeds = op % 64 != 0, .body = std::string{r.body()}};
    }

    // -- faults ----------------------------------------------------------------------------------------------------

    void go_wrong() {
        if (over_) {
            return;
        }
        ++report_.faults;
        // Many of them where the work is.
        const auto host = chance_.chance(300) ? any_busy() : any_host();
        const auto span = milliseconds{chance_.between(20, 1500)};
        const bool runs = node(host) != nullptr;
        switch (chance_.below(8)) {
        case 0:
            if (!steady_.contains(host)) {
                end_node(host, span);
            }
            break;
        case 1: stop_in_order(host, span); break;
        case 2:
            if (runs) {
                net_.cut(host, chance_.below(8));
            }
            break;
        case 3: net_.cut(setup_.nodes + chance_.below(setup_.clients), 0); break;
        case 4: net_.part(host, any_neighbour(host), time_.now() + span); break;
        case 5: net_.mute(host, any_neighbour(host), time_.now() + span); break;
        case 6: freeze(host, span); break;
        default: jump(host, span);
        }
        time_.later(chance_.within(microseconds{120'000'000} / (setup_.faults_per_minute * setup_.nodes)),
                    [this] { go_wrong(); });
    }

    void stop_in_order(unsigned host, milliseconds down) {
        auto* n = node(host);
        if (n == nullptr || n->frozen() || pool_of(host).draining() || steady_.contains(host)) {
            return;
        }
        watcher_.saw(n->name(), "leaves in order");
        n->local().discovery().leave();
        const auto end = [this, host, down, run = runs_[host]] {
            if (node(host) != nullptr && runs_[host] == run) {
                time_.at(time_.now(), [this, host, down] { end_node(host, down); });
            }
        };
        pool_of(host).drain(
            drain_limit, [n, end] { n->local().close(close_limit, when_ended([end](std::string_view) { end(); })); });
    }

    // The nodes with smaller numbers cannot reach the others.
    void cut_in_two() {
        const auto until = time_.now() + milliseconds{chance_.between(200, 2000)};
        for (unsigned a = 0; a < setup_.nodes / 2; ++a) {
            for (const auto b : links_.of(a)) {
                if (b >= setup_.nodes / 2) {
                    net_.part(a, b, until);
                }
            }
        }
    }

    // Until each node has a route to each other.
    void pass_until_routes() {
        const auto limit = time_.now() + seconds{60};
        while (const auto missing = missing_routes()) {
            if (time_.now() > limit) {
                watcher_.broken(rule::routes_found, std::to_string(missing) + " routes are missing");
                return;
            }
            pass(milliseconds{250});
        }
    }

    std::size_t missing_routes() {
        std::size_t missing = 0;
        for (unsigned host = 0; host < setup_.nodes; ++host) {
            const auto& routes = node(host)->node()->gossip_responder->reach();
            for (unsigned other = 0; other < setup_.nodes; ++other) {
                missing += other == host || routes.hops_to(mesh_name(other)) ? 0 : 1;
            }
        }
        return missing;
    }

    unsigned any_host() { return chance_.below(setup_.nodes); }
    unsigned any_busy() { return busy_[chance_.below(chance_.between(1, static_cast<unsigned>(busy_.size())))]; }
    unsigned any_neighbour(unsigned host) {
        const auto& all = links_.of(host);
        return *std::next(all.begin(), chance_.below(static_cast<unsigned>(all.size())));
    }

    // -- jobs ------------------------------------------------------------------------------------------------------

    static std::string body_of(std::uint32_t op) { return "{\"op\":" + std::to_string(op) + "}"; }

    std::string any_target(unsigned by) {
        return chance_.chance(250)   ? "any"
               : chance_.chance(600) ? mesh_name(clients_[by].entry)
               : chance_.chance(700) ? mesh_name(any_busy())
                                     : mesh_name(any_host());
    }

    void submit_burst(unsigned count, bool vital) {
        const auto by = chance_.below(setup_.clients);
        const auto target = any_target(by);
        for (unsigned i = 0; i < count; ++i) {
            submit(by, target, vital);
        }
    }

    void submit(unsigned by_client, const std::string& target, bool vital) {
        const bool again = chance_.chance(500);
        const auto work = vital ? 10U : chance_.chance(2) ? chance_.between(200, 2000) : chance_.between(1, 24);
        const auto limit = vital ? vital_deadline : milliseconds{chance_.between(50, 4000)};
        const auto op = requests_.add({.most_runs = again && target == "any" ? 2U : 1U, // it may be repeated once
                                       .vital = vital,
                                       .deadline = time_.now() + limit});
        const auto noun = target + (again ? ":again/" : ":once/") + std::to_string(op) + "/" + std::to_string(work) +
                          "/" + std::to_string(by_client);
        const auto& [entry, by] = clients_[by_client];
        auto& n = *node(setup_.nodes + by_client);
        const auto ticket =
            n.ask(entry, by, {.verb = verb::delegate, .noun = noun, .body = body_of(op), .deadline = limit},
                  requests_.operation(op));
        if (!vital && chance_.chance(30)) {
            n.later(chance_.within(milliseconds{100}), [&n, ticket] { n.cancel(ticket); });
        }
    }

    // -- checks ----------------------------------------------------------------------------------------------------

    // Nodes that gossip are never at rest, but nothing is left of the jobs, and nobody grants anything.
    void judge_rest() {
        std::map<unsigned, std::uint64_t> grants;
        for (unsigned host = 0; host < setup_.nodes; ++host) {
            auto& n = *node(host);
            const auto& counts = n.node()->counts;
            grants[host] = counts.grants_sent;
            if (counts.handlers_running != 0 || counts.routed != 0) {
                watcher_.broken(rule::at_rest, n.name() + ": " + std::to_string(counts.handlers_running) +
                                                   " handlers that run and " + std::to_string(counts.routed) +
                                                   " requests that other nodes serve");
            }
            pool_of(host).check_rest();
            count(n);
        }
        pass(seconds{2});
        for (const auto& [host, sent] : grants) {
            if (node(host)->node()->counts.grants_sent != sent) {
                watcher_.broken(rule::at_rest, node(host)->name() + " grants slots though there are no jobs");
            }
        }
    }

    const sharing_setup setup_;
    const graph links_;
    std::vector<unsigned> busy_; // the hosts to which most jobs are submitted, the busiest first
    std::vector<client> clients_;
    // Hosts to which clients send datagrams. They run on: one that restarts cannot know which requests it has served.
    std::set<unsigned> steady_;
    std::map<unsigned, unsigned> runs_;
    bool over_ = false; // nothing goes wrong any more
};

} // namespace

work_report simulate_sharing(std::uint64_t seed, const sharing_setup& setup, planted fault) {
    return sharing_mesh{seed, setup, fault}.live();
}

} // namespace cles::simulation
